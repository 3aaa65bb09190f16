#include "scene/points/point_scene.h"

#include <cmath>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "scene/points/point_cursor.h"

namespace voxdag::points {
namespace {

class PointScene : public TriangleSource {
 public:
  PointScene(std::unique_ptr<const PointFile> points, const PointOptions& options,
             MemoryBudget& budget, const CancelToken& cancel)
      : points_(std::move(points)), options_(options), budget_(budget), cancel_(cancel) {}

  std::unique_ptr<TriangleCursor> open(unsigned cursors) override {
    return std::make_unique<PointCursor>(*points_, options_, cursors, budget_, cancel_);
  }
  uint64_t declared_triangles() const override {
    return points_->count() * triangles_of_point(options_);
  }
  std::vector<SourceFile> files() const override {
    return {{points_->file().path(), points_->file().identity()}};
  }
  UsedOptions used_options() const override {
    return {.point_radius = true, .columns = points_->has_columns(), .ignored_extensions = {}};
  }
  std::vector<Warning> warnings() const override { return points_->warnings(); }

 private:
  const std::unique_ptr<const PointFile> points_;
  const PointOptions options_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
};

}  // namespace

std::unique_ptr<TriangleSource> make_point_scene(std::unique_ptr<const PointFile> points,
                                                 const SceneOptions& options, MemoryBudget& budget,
                                                 const CancelToken& cancel) {
  if (!std::isfinite(options.point_radius) || options.point_radius < 0)
    throw Error(ErrorCode::kInvalidInput, "the point radius is " +
                                              std::to_string(options.point_radius) +
                                              ", expected a finite number, 0 or more");
  const PointOptions point_options{options.point_radius, options.skip_invalid};
  return std::make_unique<PointScene>(std::move(points), point_options, budget, cancel);
}

}  // namespace voxdag::points
