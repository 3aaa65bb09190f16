// A random sample of the voxels near a scene's surface, to compare with a file. A seed determines
// the sample. The voxels are computed from the scene's triangles, without the code that builds
// DAGs. The sample consists of boxes of voxels around random points of random triangles. Half of
// the triangles are drawn uniformly, and half with a probability proportional to their area. So the
// sample covers both a floor of two large triangles and the leaves of a tree, a million small
// triangles. Takes two passes over the scene. Memory depends only on the size of the sample.
#pragma once

#include <bitset>
#include <cstdint>
#include <vector>

#include "core/base/progress.h"
#include "core/color/cutouts/cutouts.h"
#include "core/format/global/voxdag_reader.h"
#include "core/geometry/grid.h"
#include "core/geometry/voxel_rule.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

inline constexpr int64_t kBoxEdge = 16;  // in voxels; a smaller grid is one box
inline constexpr size_t kSampleBoxes = 256;

struct SampleBox {
  int64_t low[3];  // in voxels
  int64_t edge;
  // The voxel at low + (x, y, z) is bit (x * kBoxEdge + y) * kBoxEdge + z.
  std::bitset<kBoxEdge * kBoxEdge * kBoxEdge> set;
};

// Computes a sample. Returns at most kSampleBoxes boxes, and none if no triangle touches the grid.
// `cutouts`: the invisible texels, if the build has left out invisible parts of the surface;
// otherwise null. `rule`: the rule of the build; kShell if `cutouts` is not null.
std::vector<SampleBox> sample_surface(TriangleSource& scene, const Grid& grid, uint64_t seed,
                                      Progress& progress, const CancelToken& cancel,
                                      const Cutouts* cutouts = nullptr,
                                      VoxelRule rule = VoxelRule::kShell);

struct SampleReport {
  uint64_t boxes = 0;
  uint64_t voxels = 0;  // compared voxels
  uint64_t set = 0;     // compared voxels that are set in the sample
};

// Compares the file with a sample. Throws Error{kCorrupt} with the first voxel that differs. If the
// file is a solid, compares only voxels that are set in the sample.
SampleReport compare_with_sample(const voxdag_reader::File& file,
                                 const std::vector<SampleBox>& boxes, bool is_solid = false);

}  // namespace voxdag::query
