// Writes the tiles and color pages of a global file as a package (package_index.h). The bytes
// depend only on the DAG, its colors, the options that are documented here, and the version of
// zlib.
//
// The blocks of a band are encoded in parallel. The memory is limited by the budget: only the
// numbers of the tiles of one band must be in memory (tile_numbers.h).
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/file_system.h"
#include "query/package/package_index.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// A file of the viewer. The name of a hashed file gets the hash of its contents.
struct ViewerFile {
  std::string name;
  std::string contents;
};

struct PackageSpec {
  std::string output;  // the folder
  // Manifest for viewers, as JSON, without digest. It must fit tiles of kPackageTileLevels levels.
  std::string manifest;
  bool colors = true;  // write the colors of a file that has colors
  uint64_t pack_bytes = uint64_t{8} << 20;
  uint64_t memory_bytes = uint64_t{1} << 30;
  unsigned threads = 1;
  // Maximum memory of a list of nodes, in addition to the share of memory_bytes. Tests set a small
  // limit.
  uint64_t list_bytes = ~uint64_t{0};
};

struct PackageReport {
  uint64_t bytes = 0;  // of all files
  uint64_t files = 0;
  uint64_t packs = 0;
  uint64_t tiles = 0;
  uint64_t color_pages = 0;
  uint64_t blocks = 0;
  std::string digest;
};

// `page` is the viewer's page, index.html, and `modules` are further files of the viewer, whose
// names have the hash of their contents already. Both may be empty. Throws Error:
// - the errors of PackageFolder;
// - kCorrupt for a damaged file; kNoSpace, kOutOfMemory, kCanceled.
PackageReport write_package(const voxdag_reader::File& file, const PackageSpec& spec,
                            const std::vector<ViewerFile>& viewer, FileSystem& files,
                            Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
