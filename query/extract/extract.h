// Writes a part of a global file as a new global file. The part is a coarser grid of the octree, a
// region, or a region of a coarser grid. The levels of the new file are canonical: they depend only
// on the voxels.
//
// The grid is divided into octree-aligned cubes. For each cube, one of several threads reads the
// cube's part of the DAG, builds the DAG of the selected cells in memory (part_builder.h), and
// writes it as an artifact. A cube that does not fit in the thread's share of the memory is divided
// into its eight children. The merge then makes the file from the artifacts, as in a build. So the
// memory depends on the budget, not on the size of the file. If the file has colors or other
// attributes, they are written last (part_colors.h).
#pragma once

#include <cstdint>
#include <string>

#include "core/base/progress.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/voxdag_reader.h"
#include "core/geometry/cube.h"
#include "core/geometry/grid.h"
#include "core/io/file_system.h"
#include "query/dag/selection.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

struct ExtractSpec {
  Selection selection;
  // If true, a cell of a coarser grid is set if at least half of its voxels are set, and files with
  // attributes are refused. If false, a cell is set if at least one of its voxels is set.
  bool majority = false;
  // If true, the new grid is the smallest octree-aligned cube around the region; otherwise it is
  // the complete grid.
  bool crop = false;
  std::string output;
  bool replace = false;  // replace an existing file
  uint64_t memory_bytes = uint64_t{1} << 30;
  unsigned threads = 1;
  // Maximum number of words in a narrow level. A level with more words is wide: pointers into it
  // have 64 bits instead of 32. Tests use a smaller limit.
  uint64_t narrow_words = global_layout::kNarrowLevelWords;
};

struct ExtractReport {
  Grid grid;
  uint64_t voxels = 0;
  uint64_t svo_nodes = 0;
  uint64_t dag_nodes = 0;
  uint64_t bytes = 0;
  std::string sha256;
  uint64_t parts = 0;        // cubes with voxels
  uint64_t parts_split = 0;  // cubes that did not fit in memory
  uint32_t merge_passes = 0;
  uint64_t work_bytes = 0;  // bytes written to temporary files
  // Warnings about the result, which `progress` also received.
  std::vector<std::string> warnings;
};

// Returns the smallest octree-aligned cube that contains the selection's region, in the selection's
// grid. The cube has at least 4 cells per edge.
Cube crop_cube(const Selection& selection);

// Writes the selected part of `file` to spec.output, which gets its final name when it is complete.
// Temporary files are in a folder next to the output; extract() removes the folder at the end, also
// after an error. If the process is killed, the next extract with the same output removes the
// folder. Throws Error: kInvalidInput for attributes with `majority`, kCorrupt for a damaged file,
// kNoSpace, kOutOfMemory, kCanceled, and the errors of LockedOutputs (query/dag/locked_outputs.h).
ExtractReport extract(const voxdag_reader::File& file, const ExtractSpec& spec, FileSystem& files,
                      Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
