// Writes a finished DAG, or a part of it, in the formats of other programs: docs/export.md says
// which program reads what. What a format cannot hold is refused, mostly before anything is
// written.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/file_system.h"
#include "query/dag/selection.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

struct ExportJob;

struct ExportReport {
  std::vector<std::string> files;  // written files, the requested one first
  uint64_t bytes = 0;              // of all files
  uint64_t voxels = 0;
  std::vector<std::string> notes;  // usage notes for the files, one sentence each
};

struct ExportFormat {
  const char* name;
  const char* summary;  // for a list of formats
  // What names of its files end in. A format of two files needs it: the second name is the first
  // one with `second_suffix` in its place. Otherwise both are null.
  const char* suffix;
  const char* second_suffix;
  ExportReport (*write)(const ExportJob& job);
};

// The formats of this build, which may lack those that need a library.
std::span<const ExportFormat> export_formats();
// Throws Error{kInvalidInput} that lists the names if there is no such format.
const ExportFormat& export_format(const std::string& name);
// The names of all files of an export. Throws Error{kInvalidInput} if `output` has not the suffix
// that the format needs.
std::vector<std::string> export_paths(const ExportFormat& format, const std::string& output);

struct ExportRequest {
  const ExportFormat* format = nullptr;
  Selection selection;
  std::string output;
  uint64_t memory_bytes = 0;  // limit of allocations; the mapped file is not counted
  bool gray = false;          // omits colors
  bool replace = false;       // files that exist
};

// Writes the selected voxels. The files get their final names when all are complete. After an error
// no file remains, unless the disk refuses the second of two renames. Files of a killed process are
// removed by the next export. Throws Error{kLimit} if the format cannot hold the voxels,
// Error{kOutOfMemory} if the memory cannot (the message names a selection that fits), and the
// errors of LockedOutputs.
ExportReport export_dag(FileSystem& files, const voxdag_reader::File& file,
                        const ExportRequest& request, Progress& progress,
                        const CancelToken& cancel);

}  // namespace voxdag::query
