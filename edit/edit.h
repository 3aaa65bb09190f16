// Writes a changed copy of a global file: removes spheres and boxes, adds scenes and the voxels of
// other files, and dilates or erodes the result. The command line and Python call this function.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/io/file_system.h"
#include "query/combine/combine.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// A file whose voxels are added. Its voxel (0, 0, 0) is placed at the voxel `offset` of the edited
// grid.
struct PastedFile {
  std::string path;
  std::array<int64_t, 3> offset = {};
};

// The edits are applied in the order of the first four members.
struct EditSpec {
  std::vector<std::string> cuts;    // shapes (query/combine/shape.h)
  std::vector<std::string> scenes;  // built as one scene, with the grid and attributes of the file
  std::vector<PastedFile> parts;
  // Distance in voxels (query/morphology/morphology.h); 0 if the file is not changed in this way.
  // At most one of the two is not 0.
  uint64_t dilate = 0, erode = 0;
  bool outside_set = false;  // for the erosion, voxels outside of the grid count as set
  std::string input;
  std::string output;
  bool clip = false;     // drop pasted voxels outside of the grid; otherwise they are an error
  bool replace = false;  // replace an existing file
  // These three members have the same meaning as in query::CombineSpec.
  std::optional<voxdag_reader::Rgb> fill_color;
  uint64_t color_resolution = 0;
  bool attributes = true;
  uint64_t memory_bytes = uint64_t{1} << 30;
  unsigned threads = 1;
};

// Checks all files, applies the edits, and writes the result to spec.output, which gets its final
// name when it is complete. Temporary files are in a folder next to the output. Throws Error:
// kInvalidInput if there is no edit, if there is a dilation and an erosion, if a shape is invalid,
// or if a member needs another member; and the errors of query::combine() and run_build().
query::CombineReport edit(const EditSpec& spec, FileSystem& files, Progress& progress,
                          const CancelToken& cancel);

}  // namespace voxdag
