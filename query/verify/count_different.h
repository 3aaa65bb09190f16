// Counts the voxels in which two files of the same grid differ, in limited memory. First compares
// both files with their checksums.
//
// If the files and a table of all compared pairs of nodes fit in memory, core/format/global/diff.h
// compares them. Otherwise, both DAGs are descended together, level by level. Each distinct pair of
// nodes is divided once, and has the number of places of the grid at which it occurs. The pairs of
// a level are sorted by external sorting (query/combine/spill/spill.h), so both files are read
// almost in their order.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/progress.h"
#include "core/format/global/diff.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/file_system.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

struct CountDifferentSpec {
  unsigned threads = 1;  // used if everything fits in memory
  // Limit for the memory of all tables and lists together, and for the resident memory of the
  // process, which includes mapped pages of the files.
  uint64_t memory_bytes = uint64_t{1} << 30;
  // Beginning of the path of a temporary folder, which is created only if memory is not sufficient,
  // and removed at the end.
  std::string work_prefix;
  // Additional limit for the memory of each list, and of the tables if everything fits in memory.
  // Tests set a small limit.
  uint64_t list_bytes = ~uint64_t{0};
};

struct CountDifferentReport {
  DiffReport voxels;
  uint64_t work_bytes = 0;  // bytes written to temporary files
};

// The files can have different hash bits and orders of nodes. Throws Error{kInvalidInput} if the
// grids differ, Error{kCorrupt} for a damaged file, and the errors of temporary files.
CountDifferentReport count_different(const voxdag_reader::File& a, const voxdag_reader::File& b,
                                     const CountDifferentSpec& spec, FileSystem& files,
                                     Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
