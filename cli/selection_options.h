// The options --region, --world, --level and --resolution of commands that read a part of a file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "cli/command.h"
#include "core/format/global/voxdag_reader.h"
#include "query/dag/selection.h"

namespace voxdag::cli {

struct SelectionOptions {
  std::string region;  // as typed; "" for the complete grid
  bool world = false;
  std::optional<uint64_t> level, resolution;

  void declare(Command& command);
  // Returns the selected cells of `file`. Throws Error{kInvalidInput} for a grid that is finer than
  // the file's or coarser than 4 cells per edge, and for a region that has no cell of the grid.
  query::Selection selection(const voxdag_reader::File& file) const;
};

// Parses the option --memory; "" for half of the machine's memory. Throws Error{kInvalidInput} for
// less than 64 MiB.
uint64_t memory_limit(const std::string& text);

}  // namespace voxdag::cli
