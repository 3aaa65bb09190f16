// Reads the surfaces of a scene's triangles and puts each into the bins of all cubes of the color
// grid that it touches.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/color/surface.h"
#include "core/geometry/cube.h"
#include "core/geometry/grid.h"
#include "scene/triangle_source.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/stages/attributes/color_keys.h"
#include "scheduler/triangles/surface_record.h"

namespace voxdag {

struct SurfaceBinning {
  Grid grid;
  std::span<const Material> materials;
  std::span<const Checksum128> looks;  // look_digests() of them
  std::span<const Cube> cubes;         // they cover the grid
  size_t record_bytes;                 // of a triangle, as ingest digests it (triangles/chunk.h)
  std::string digest;                  // of what ingest read
  size_t buffer_bytes;                 // for records on their way to the bins, uncharged
};

struct BinnedSurfaces {
  std::vector<ChunkList> bins;       // one for each cube, in their order
  std::vector<BinContent> contents;  // contents of each bin
};

// Throws Error{kInvalidInput} if the triangles are not those that ingest read: the scene was
// changed during the build.
BinnedSurfaces bin_surfaces(TriangleSource& scene, const SurfaceBinning& binning,
                            RecordStore& store, const StageContext& context);

}  // namespace voxdag
