// Reads the surfaces of a scene (triangles with their materials) and puts each surface into the
// bins of all cubes that it touches. The cubes divide the color grid; each cube has one bin.
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
  std::span<const Checksum128> looks;  // look_digests() of the materials
  std::span<const Cube> cubes;         // these cubes cover the grid
  const Cutouts* cutouts;              // cutouts that the build leaves out, or null
  size_t record_bytes;                 // bytes per triangle in ingest's digest (triangles/chunk.h)
  std::string digest;                  // digest of the triangles that ingest read
  size_t buffer_bytes;                 // max bytes of records not yet in the bins; uncharged
};

struct BinnedSurfaces {
  std::vector<ChunkList> bins;       // one per cube, in the order of `cubes`
  std::vector<BinContent> contents;  // contents of each bin
  bool have_colors = false;          // a surface in the grid has an image, or is not white
};

// Puts the surfaces of the scene into the bins of the cubes, and returns the bins. Their records
// are in `store`. Throws Error{kInvalidInput} if the triangles differ from the triangles that
// ingest read, which happens if the scene was changed during the build.
BinnedSurfaces bin_surfaces(TriangleSource& scene, const SurfaceBinning& binning,
                            RecordStore& store, const StageContext& context);

}  // namespace voxdag
