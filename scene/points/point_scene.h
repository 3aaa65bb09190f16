// A file of points as a scene. A point is one degenerate triangle, which sets exactly one voxel.
// With SceneOptions::point_radius it is the surface of a cube.
#pragma once

#include <memory>

#include "core/base/memory_budget.h"
#include "scene/points/point_file.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::points {

// `budget` and `cancel` must outlive the scene.
std::unique_ptr<TriangleSource> make_point_scene(std::unique_ptr<const PointFile> points,
                                                 const SceneOptions& options, MemoryBudget& budget,
                                                 const CancelToken& cancel);

}  // namespace voxdag::points
