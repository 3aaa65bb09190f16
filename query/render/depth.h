// Depth maps: the distance to the visible cell for each pixel, for programs that compare or combine
// pictures.
#pragma once

#include <string>
#include <vector>

#include "query/dag/dag_view.h"
#include "query/render/camera.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

struct DepthMap {
  int width = 0, height = 0;
  // One value per pixel, in rows from the top: the distance in voxels along the ray through the
  // center of the pixel; infinity if the ray meets no surface.
  std::vector<float> depths;
};

// Computes the depth map of a view. If the grid has no voxels, all distances are infinite. Throws
// the errors of render_picture().
DepthMap render_depth(const DagView& dag, const Placement& placement, int width, int height,
                      unsigned threads, const CancelToken& cancel);

// Memory per pixel, in bytes, for a map and the file that encode_npy() makes of it.
inline constexpr uint64_t kDepthBytesPerPixel = 2 * sizeof(float);

// Returns the bytes of a file for numpy.load(): an array of float32 with the shape (height, width).
std::string encode_npy(const DepthMap& map);

}  // namespace voxdag::query
