// The common part of the fuzz targets. A target is a function that passes the input bytes to a
// decoder, and aborts if a property does not hold. Errors that the decoder documents are valid
// results. Every other exception ends the process, which the fuzzer reports as a finding.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <vector>

#include "core/format/bytes.h"
#include "core/format/checksum.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace voxdag::fuzz {

// Aborts the process with a message unless `holds` is true.
inline void require(bool holds, const char* property) {
  if (holds) return;
  std::fprintf(stderr, "fuzz target: this does not hold: %s\n", property);
  std::abort();
}

inline std::span<const std::byte> bytes_of(const uint8_t* data, size_t size) {
  return std::as_bytes(std::span(data, size));
}

// Returns the bytes followed by the checksum that the decoders of records expect.
inline std::vector<std::byte> with_checksum(std::span<const std::byte> bytes) {
  std::vector<std::byte> record(bytes.begin(), bytes.end());
  ByteSink(record).put(checksum64(bytes));
  return record;
}

}  // namespace voxdag::fuzz
