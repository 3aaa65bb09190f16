// The options --region, --world, --level and --resolution, for commands that read a part of a file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "cli/command.h"
#include "core/format/global/voxdag_reader.h"
#include "query/dag/selection.h"

namespace voxdag::cli {

struct SelectionOptions {
  std::string region;  // text of the option; "" for the complete grid
  bool world = false;
  std::optional<uint64_t> level, resolution;  // at most one of the two

  void declare(Command& command);
  // Returns the selected cells of `file`. Throws Error{kInvalidInput} if the selected grid is finer
  // than the file's grid or has fewer than 4 cells per edge, or if the region contains no cell.
  query::Selection selection(const voxdag_reader::File& file) const;
};

// Parses the value of --memory and returns bytes; "" means half of the machine's memory. Throws
// Error{kInvalidInput} for less than 64 MiB.
uint64_t memory_limit(const std::string& text);
// Returns the beginning of the paths of temporary folders: in the folder `work` or, if it is empty,
// next to the file `path`.
std::string work_prefix(const std::string& path, const std::string& work);

}  // namespace voxdag::cli
