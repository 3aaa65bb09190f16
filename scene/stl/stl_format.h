// Distinguishes binary from ASCII STL files. A binary file has 80 bytes of header, the number n of
// its facets in 4 bytes, and 50 bytes per facet:
//
//   byte  0          80      84                  84 + 50 n
//         | header   | n     | facet | facet ... |
//
//   facet: normal (3 floats), three vertices (9 floats), attribute (2 bytes); little-endian
//
// Many headers begin with "solid", like ASCII files. So a file of 84 + 50 n bytes is binary,
// however it begins. A file of any other size is ASCII if it begins like an ASCII file. Otherwise
// it is binary if its first facets are plausible. Then n does not match the size because the file
// is cut off, has other data after the facets, or has an unknown number of facets.
#pragma once

#include <cstdint>

#include "core/io/file_system.h"

namespace voxdag::stl {

enum class Format { kNone, kAscii, kBinary };

constexpr uint64_t kHeaderBytes = 84;
constexpr uint64_t kFacetBytes = 50;
constexpr uint64_t kCountAt = 80;

// Returns kNone if the file is not STL.
Format format_of(const ReadableFile& file);

// Returns the number of facets that the header of a binary file declares.
uint64_t declared_facets(const ReadableFile& file);

}  // namespace voxdag::stl
