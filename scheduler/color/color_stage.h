// The colors of a scene (docs/color.md): its surfaces are read once more, binned by cubes of the
// color grid, baked on all threads, and written in Morton order behind the levels of the global
// file. Nothing of it is durable before the file is: a build that is stopped before bakes again.
#pragma once

#include <cstdint>
#include <string>

#include "core/format/global/global_writer.h"
#include "core/geometry/grid.h"
#include "scheduler/build_spec.h"

namespace voxdag {

struct ColorSource {
  const GeometryOptions& options;  // with a color resolution
  Grid grid;
  std::string digest;       // of the scene's triangles, as ingest read them
  std::string work_folder;  // for scratch files
};

struct ColorReport {
  uint64_t resolution = 0;               // of the color grid; 0 for a file without colors
  uint64_t cells = 0;                    // of that grid, that have a color
  uint64_t images = 0, image_bytes = 0;  // and their pyramids
  uint64_t spill_bytes = 0;
};

// `out` has all its levels, and is not sealed; it stays as it is if there are none. Throws Error.
ColorReport add_colors(const ColorSource& source, GlobalFileWriter& out,
                       const StageContext& context);

}  // namespace voxdag
