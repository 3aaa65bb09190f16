#include "query/verify/surface_sample.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <queue>
#include <random>
#include <string>

#include "core/base/error.h"
#include "core/color/cutouts/visible_part.h"
#include "core/color/snap_surface.h"
#include "core/geometry/crossing.h"
#include "core/geometry/overlap.h"

namespace voxdag::query {
namespace {

class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}
  // Returns a random number between 0 and 1, exclusive.
  double unit() { return (static_cast<double>(engine_() >> 11) + 0.5) * 0x1p-53; }
  // Returns a random number from 0 to count - 1.
  int64_t below(int64_t count) {
    return static_cast<int64_t>(engine_() % static_cast<uint64_t>(count));
  }

 private:
  std::mt19937_64 engine_;
};

// Draws a sample of `size` items from a stream, without replacement. The probability of an item is
// proportional to its weight. Each item gets a random key, exponentially distributed with the
// item's weight as rate, and the items with the smallest keys are kept (Efraimidis & Spirakis
// 2006).
class Reservoir {
 public:
  explicit Reservoir(size_t size) : size_(size) {}
  void offer(const FixedTriangle& triangle, double weight, Random& random) {
    if (!(weight > 0)) return;
    const double key = -std::log(random.unit()) / weight;
    if (sampled_.size() == size_ && key >= sampled_.top().key) return;
    if (sampled_.size() == size_) sampled_.pop();
    sampled_.push({key, triangle});
  }
  void drain_to(std::vector<FixedTriangle>& out) {
    for (; !sampled_.empty(); sampled_.pop()) out.push_back(sampled_.top().triangle);
  }

 private:
  struct Item {
    double key;
    FixedTriangle triangle;
    bool operator<(const Item& o) const { return key < o.key; }
  };
  const size_t size_;
  std::priority_queue<Item> sampled_;
};

double area(const FixedTriangle& t) {
  double e[2][3], sum = 0;
  for (int i = 0; i < 2; ++i)
    for (int a = 0; a < 3; ++a) e[i][a] = static_cast<double>(t.v[i + 1][a] - t.v[0][a]);
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    const double n = e[0][b] * e[1][c] - e[0][c] * e[1][b];
    sum += n * n;
  }
  return std::sqrt(sum);
}

// The triangles of the scene that can touch the grid. Each function calls visit() for each of these
// triangles, in the order of the scene.
class SnappedScene {
 public:
  SnappedScene(TriangleSource& scene, const Grid& grid, Progress& progress,
               const CancelToken& cancel)
      : scene_(scene), grid_(grid), progress_(progress), cancel_(cancel) {}

  template <class Visit>
  void for_each_triangle(const Visit& visit) const {
    scene_.for_each_batch([&](std::span<const WorldTriangle> batch) {
      begin(batch.size());
      FixedTriangle triangle;
      for (const WorldTriangle& world : batch)
        if (is_inside(snap_triangle(grid_, world, triangle))) visit(triangle);
    });
  }
  template <class Visit>
  void for_each_surface(const Visit& visit) const {
    const auto cursor = scene_.open(1);
    cursor->read_surfaces(0, scene_.declared_triangles(),
                          [&](std::span<const SurfaceTriangle> batch) {
                            begin(batch.size());
                            FixedSurface surface;
                            for (const SurfaceTriangle& world : batch)
                              if (is_inside(snap_surface(grid_, world, surface))) visit(surface);
                          });
  }

 private:
  void begin(size_t triangles) const {
    cancel_.check();
    progress_.advance(triangles);
  }
  static bool is_inside(SnapResult result) {
    if (result == SnapResult::kTooFar)
      throw Error(
          ErrorCode::kLimit,
          "a triangle of the scene reaches into the file's grid and has a vertex 2^32 or more "
          "voxels away from the grid's low corner: expected a scene that voxdag can build");
    return result == SnapResult::kInside;
  }

  TriangleSource& scene_;
  const Grid& grid_;
  Progress& progress_;
  const CancelToken& cancel_;
};

std::vector<FixedTriangle> draw_triangles(const SnappedScene& scene, Random& random) {
  Reservoir uniform(kSampleBoxes / 2), by_area(kSampleBoxes / 2);
  scene.for_each_triangle([&](const FixedTriangle& triangle) {
    uniform.offer(triangle, 1.0, random);
    by_area.offer(triangle, area(triangle), random);
  });
  std::vector<FixedTriangle> drawn;
  uniform.drain_to(drawn);
  by_area.drain_to(drawn);
  return drawn;
}

// Returns the voxel at a random point of the triangle; nullopt if the point is outside the grid.
std::optional<std::array<int64_t, 3>> random_voxel(const FixedTriangle& t, const Grid& grid,
                                                   Random& random) {
  double p = random.unit(), q = random.unit();
  if (p + q > 1) p = 1 - p, q = 1 - q;
  std::array<int64_t, 3> voxel;
  for (int a = 0; a < 3; ++a) {
    const double u = static_cast<double>(t.v[0][a]) +
                     p * static_cast<double>(t.v[1][a] - t.v[0][a]) +
                     q * static_cast<double>(t.v[2][a] - t.v[0][a]);
    voxel[a] = static_cast<int64_t>(std::floor(u / static_cast<double>(kUnitsPerVoxel)));
    if (voxel[a] < 0 || voxel[a] >= grid.resolution()) return std::nullopt;
  }
  return voxel;
}

SampleBox box_around(const std::array<int64_t, 3>& voxel, const Grid& grid, Random& random) {
  SampleBox box;
  box.edge = std::min(kBoxEdge, grid.resolution());
  for (int a = 0; a < 3; ++a)
    box.low[a] =
        std::clamp<int64_t>(voxel[a] - random.below(box.edge), 0, grid.resolution() - box.edge);
  return box;
}

size_t bit_of(const SampleBox& box, int64_t x, int64_t y, int64_t z) {
  return static_cast<size_t>(((x - box.low[0]) * kBoxEdge + (y - box.low[1])) * kBoxEdge +
                             (z - box.low[2]));
}

// Visits the rows along `axis` through the centers of the box's voxels. If the triangle crosses a
// row in a voxel of the box, sets this voxel. `test` is a RowTest (crossing.h).
template <class Test>
void mark_rows(const Test& test, int axis, SampleBox& box) {
  const int b = (axis + 1) % 3, c = (axis + 2) % 3;
  const auto center = [](int64_t voxel) { return voxel * kUnitsPerVoxel + kUnitsPerVoxel / 2; };
  int64_t at[3];
  for (at[b] = box.low[b]; at[b] < box.low[b] + box.edge; ++at[b])
    for (at[c] = box.low[c]; at[c] < box.low[c] + box.edge; ++at[c]) {
      if (!test.crosses(center(at[b]), center(at[c]))) continue;
      at[axis] = test.first_beyond(center(at[b]), center(at[c]), kUnitBits) - 1;
      if (at[axis] >= box.low[axis] && at[axis] < box.low[axis] + box.edge)
        box.set.set(bit_of(box, at[0], at[1], at[2]));
    }
}

// Sets the voxels of the box that the rule kThin sets for the triangle.
void mark_thin(const FixedTriangle& t, SampleBox& box) {
  for (int a = 0; a < 3; ++a)
    if (t.high(a) < box.low[a] * kUnitsPerVoxel ||
        t.low(a) > (box.low[a] + box.edge) * kUnitsPerVoxel)
      return;
  for (int axis = 0; axis < 3; ++axis)
    with_row_test(t, axis, [&](const auto& test) { mark_rows(test, axis, box); });
}

// Sets the voxels of the box that the triangle touches, and in which it is visible. `part` is null
// if the complete triangle is visible.
void mark(const FixedTriangle& t, const VisiblePart* part, SampleBox& box) {
  int64_t first[3], last[3], corner[3];
  for (int a = 0; a < 3; ++a) {
    first[a] = std::max(box.low[a], t.low(a) >> kUnitBits);
    last[a] = std::min(box.low[a] + box.edge - 1, t.high(a) >> kUnitBits);
    if (first[a] > last[a]) return;
    corner[a] = box.low[a] * kUnitsPerVoxel;
  }
  if (!triangle_touches_cube(t, corner, box.edge * kUnitsPerVoxel)) return;
  for (int64_t x = first[0]; x <= last[0]; ++x)
    for (int64_t y = first[1]; y <= last[1]; ++y)
      for (int64_t z = first[2]; z <= last[2]; ++z) {
        const int64_t low[3] = {x * kUnitsPerVoxel, y * kUnitsPerVoxel, z * kUnitsPerVoxel};
        const size_t bit = bit_of(box, x, y, z);
        if (!box.set[bit] && triangle_touches_cube(t, low, kUnitsPerVoxel) &&
            (!part || part->is_visible({x, y, z})))
          box.set.set(bit);
      }
}

}  // namespace

std::vector<SampleBox> sample_surface(TriangleSource& scene, const Grid& grid, uint64_t seed,
                                      Progress& progress, const CancelToken& cancel,
                                      const Cutouts* cutouts, VoxelRule rule) {
  const SnappedScene snapped(scene, grid, progress, cancel);
  progress.begin_stage("sample", 2 * scene.declared_triangles(), "triangles");
  Random random(seed);
  std::vector<SampleBox> boxes;
  for (const FixedTriangle& triangle : draw_triangles(snapped, random)) {
    // Maximum number of random points per triangle. The first ones can be outside the grid, because
    // a triangle can be mostly outside the grid.
    constexpr int kTries = 16;
    std::optional<std::array<int64_t, 3>> voxel;
    for (int i = 0; i < kTries && !voxel; ++i) voxel = random_voxel(triangle, grid, random);
    if (voxel) boxes.push_back(box_around(*voxel, grid, random));
  }
  std::sort(boxes.begin(), boxes.end(),
            [](const SampleBox& a, const SampleBox& b) { return a.low[0] < b.low[0]; });
  // `surface` is null if no part of the triangle can be invisible: its material is opaque, or
  // cutouts are kept.
  const auto mark_boxes = [&](const FixedTriangle& triangle, const FixedSurface* surface) {
    const int64_t first = (triangle.low(0) >> kUnitBits) - kBoxEdge + 1;
    const int64_t last = triangle.high(0) >> kUnitBits;
    auto box = std::lower_bound(boxes.begin(), boxes.end(), first,
                                [](const SampleBox& b, int64_t x) { return b.low[0] < x; });
    if (box == boxes.end() || box->low[0] > last) return;
    std::optional<VisiblePart> part;
    if (surface) part.emplace(*surface, *cutouts, grid.levels);
    for (; box != boxes.end() && box->low[0] <= last; ++box)
      rule == VoxelRule::kThin ? mark_thin(triangle, *box)
                               : mark(triangle, part ? &*part : nullptr, *box);
  };
  if (cutouts)
    snapped.for_each_surface([&](const FixedSurface& surface) {
      mark_boxes(surface.position, cutouts->may_cut(surface.material) ? &surface : nullptr);
    });
  else
    snapped.for_each_triangle([&](const FixedTriangle& t) { mark_boxes(t, nullptr); });
  progress.end_stage();
  return boxes;
}

SampleReport compare_with_sample(const voxdag_reader::File& file,
                                 const std::vector<SampleBox>& boxes, bool is_solid) {
  SampleReport report;
  report.boxes = boxes.size();
  uint64_t wrong = 0;
  std::string first_wrong;
  for (const SampleBox& box : boxes)
    for (int64_t x = 0; x < box.edge; ++x)
      for (int64_t y = 0; y < box.edge; ++y)
        for (int64_t z = 0; z < box.edge; ++z) {
          const bool expected = box.set[static_cast<size_t>((x * kBoxEdge + y) * kBoxEdge + z)];
          if (is_solid && !expected) continue;
          ++report.voxels;
          report.set += expected;
          if (file.voxel(box.low[0] + x, box.low[1] + y, box.low[2] + z) == expected) continue;
          if (wrong++ == 0)
            first_wrong = std::to_string(box.low[0] + x) + " " + std::to_string(box.low[1] + y) +
                          " " + std::to_string(box.low[2] + z) +
                          (expected ? " is not set, but a triangle sets it"
                                    : " is set, but no triangle sets it");
        }
  if (wrong > 0)
    throw Error(ErrorCode::kCorrupt, file.path() + ": " + std::to_string(wrong) + " of " +
                                         std::to_string(report.voxels) +
                                         " sampled voxels differ from the scene; voxel " +
                                         first_wrong);
  if (boxes.empty() && file.voxels() != 0)
    throw Error(ErrorCode::kCorrupt, file.path() + ": the file has " +
                                         std::to_string(file.voxels()) +
                                         " voxels, but the scene has no triangle in its grid");
  return report;
}

}  // namespace voxdag::query
