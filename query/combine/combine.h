// Computes the union, difference, intersection or symmetric difference of two global files of the
// same grid. The levels of the new file are canonical: they depend only on the voxels.
//
//   join.h          the equal nodes of the two files, and the hashes of all nodes
//   pair_levels.h   the pairs of cubes that must be combined, and the nodes to keep
//   level_writer.h  the levels of the new file
//   count_levels.h  the numbers of voxels and octree nodes
//   new_file.h      the complete file
//   moved.h         the second file at an offset, which is written to a temporary file first
//   shape.h         spheres and boxes as the second operand
//
// query/attributes/combined_section.h writes colors and other attributes of the new file.
//
// pair_levels.h and moved.h work from the root down to the bricks. join.h, level_writer.h and
// count_levels.h work from the bricks up to the root.
//
// The time depends on the sizes of the files and on the number of distinct pairs of cubes. The
// memory is limited by the budget: lists that exceed their share, and the values (node_values.h) of
// large levels, are stored in a scratch folder. Only the marks of kept and counted nodes
// (pair_levels.h) must be in memory. Each of these two kinds of marks takes one bit for each two
// words of two consecutive levels.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "core/base/progress.h"
#include "core/color/attribute_set.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/voxdag_reader.h"
#include "core/geometry/grid.h"
#include "core/io/file_system.h"
#include "query/combine/operation.h"
#include "query/combine/shape.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

struct CombineSpec {
  Operation operation = Operation::kUnion;
  std::string output;
  // Name of the first file in messages, if it is not the file's path.
  std::string first_name;
  // If set, moves the second file: its voxel (0, 0, 0) is placed at this voxel of the first file's
  // grid. Then the grids of the two files can differ in position and resolution, but their voxels
  // must have the same edge.
  std::optional<std::array<int64_t, 3>> offset;
  bool clip = false;     // drop moved voxels outside of the grid; otherwise they are an error
  bool replace = false;  // replace an existing file
  // If true, the output is the input of another step. It is neither synced nor read back, and the
  // report has no SHA-256.
  bool temporary = false;
  // If false, the new file has no attributes.
  bool attributes = true;
  // Used if only one of the files has colors: the color of cells in which that file has no voxel.
  std::optional<voxdag_reader::Rgb> fill_color;
  // Maximum number of color cells per edge of the new file's grid, a power of two; 0: no limit.
  uint64_t color_resolution = 0;
  uint64_t memory_bytes = uint64_t{1} << 30;
  // Threads that encode attributes. The finished file is read back to compute its SHA-256. With 2
  // or more, a background thread computes it for one part while the next part is read.
  unsigned threads = 1;
  // Maximum number of words in a narrow level. A level with more words is wide: pointers into it
  // have 64 bits instead of 32. Tests use a smaller limit.
  uint64_t narrow_words = global_layout::kNarrowLevelWords;
  // Additional limit for the memory of each list and of the values of each level, which otherwise
  // get a fixed share of memory_bytes. Tests set a small limit.
  uint64_t list_bytes = ~uint64_t{0};
};

struct CombineReport {
  Grid grid;
  uint64_t voxels = 0;
  uint64_t svo_nodes = 0;
  uint64_t dag_nodes = 0;
  uint64_t bytes = 0;
  std::string sha256;       // empty if spec.temporary is true
  uint64_t pairs = 0;       // distinct pairs of nodes that were combined
  uint64_t clipped = 0;     // moved voxels outside of the grid
  uint64_t work_bytes = 0;  // bytes written to temporary files
};

// What check_combinable() must know about the first file, which need not exist yet.
struct FirstFile {
  const voxdag_reader::File& grid;  // a file with the same grid, hash bits and node order
  std::string name;                 // for error messages
  AttributeSet attributes;
  bool is_empty = false;  // true if it has no voxels
};

// Throws the errors of kind kInvalidInput that combine() throws for these files, except that it
// does not always detect voxels outside of the grid, because this can need a walk through all
// voxels. Returns the attributes of the result.
AttributeSet check_combinable(const FirstFile& a, const voxdag_reader::File& b,
                              const CombineSpec& spec);
// True if the result has cells whose color is spec.fill_color if it is set.
bool needs_fill_color(const FirstFile& a, const voxdag_reader::File& b, const CombineSpec& spec);

// Writes the result to spec.output, which gets its final name when it is complete. Temporary files
// are in a folder next to the output; combine() removes the folder at the end, also after an error.
// If the process is killed, the next combine with the same output removes the folder. Throws Error:
// - kInvalidInput in these cases:
//   - The files have different grids. With spec.offset, only the edge of a voxel must be the same.
//   - The files have different hash bits.
//   - The nodes of a file are not in the order by hash. With spec.offset, only the first file must
//     have this order.
//   - Moved voxels are outside of the grid, and spec.clip is false.
//   - spec.clip is true without spec.offset.
//   - spec.fill_color or spec.color_resolution is set, but spec.attributes is false.
//   - The operation needs an attribute that only one file has (docs/extract.md).
//   - spec.color_resolution is not a power of two from 4 to the resolution, or so small that a
//   color
//     cell would be larger than one of the files.
// - kCorrupt for a damaged file; kNoSpace, kOutOfMemory, kCanceled.
// - The errors of LockedOutputs.
CombineReport combine(const voxdag_reader::File& a, const voxdag_reader::File& b,
                      const CombineSpec& spec, FileSystem& files, Progress& progress,
                      const CancelToken& cancel);

// Writes `a` without the voxels in the shape to spec.output, in the same way as combine(). Uses
// neither the operation nor the offset in `spec`.
CombineReport cut(const voxdag_reader::File& a, const Shape& shape, const CombineSpec& spec,
                  FileSystem& files, Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
