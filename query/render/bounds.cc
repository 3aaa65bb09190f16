#include "query/render/bounds.h"

#include <algorithm>

namespace voxdag::query {
namespace {

constexpr uint32_t kDepth = 11;
constexpr uint32_t kPointDepth = 6;

class Search {
 public:
  explicit Search(const DagView& dag) : dag_(dag), depth_(std::min(dag.grid_levels(), kDepth)) {
    visit(0, {0, 0, 0}, dag.root());
  }

  Box box() const {
    const double size = static_cast<double>(dag_.resolution() >> depth_);
    Box b;
    for (int axis = 0; axis < 3; ++axis) {
      b.low[axis] = static_cast<double>(low_[axis]) * size;
      b.high[axis] = static_cast<double>(high_[axis]) * size;
    }
    return b;
  }

 private:
  struct Cell {
    int64_t c[3];
  };

  void visit(uint32_t depth, const Cell& cell, uint64_t content) {
    if (inside(depth, cell)) return;
    if (depth == depth_) return add(cell);
    const DagView::Children children = dag_.children(depth, content);
    // The corners first: they widen the box, and most of the rest then lies inside.
    for (int i : {0, 7, 3, 4, 5, 2, 1, 6})
      if (children.has(i))
        visit(depth + 1,
              {{2 * cell.c[0] + (i >> 2), 2 * cell.c[1] + (i >> 1 & 1), 2 * cell.c[2] + (i & 1)}},
              dag_.content(depth, children, i));
  }

  bool inside(uint32_t depth, const Cell& cell) const {
    const uint32_t shift = depth_ - depth;
    for (int axis = 0; axis < 3; ++axis)
      if (cell.c[axis] << shift < low_[axis] || (cell.c[axis] + 1) << shift > high_[axis])
        return false;
    return true;
  }

  void add(const Cell& cell) {
    for (int axis = 0; axis < 3; ++axis) {
      low_[axis] = std::min(low_[axis], cell.c[axis]);
      high_[axis] = std::max(high_[axis], cell.c[axis] + 1);
    }
  }

  const DagView& dag_;
  const uint32_t depth_;
  int64_t low_[3] = {INT64_MAX, INT64_MAX, INT64_MAX};
  int64_t high_[3] = {INT64_MIN, INT64_MIN, INT64_MIN};
};

void add_points(const DagView& dag, uint32_t depth, const Vec& low, uint64_t content,
                std::vector<Vec>& points) {
  const double half = static_cast<double>(dag.resolution() >> depth) / 2;
  if (depth == std::min(dag.grid_levels(), kPointDepth))
    return points.push_back(low + Vec{{half, half, half}});
  const DagView::Children children = dag.children(depth, content);
  for (int i = 0; i < 8; ++i)
    if (children.has(i))
      add_points(dag, depth + 1, low + Vec{{i & 4 ? half : 0, i & 2 ? half : 0, i & 1 ? half : 0}},
                 dag.content(depth, children, i), points);
}

}  // namespace

Box occupied_box(const DagView& dag) { return Search(dag).box(); }

std::vector<Vec> occupied_points(const DagView& dag) {
  std::vector<Vec> points;
  add_points(dag, 0, {{0, 0, 0}}, dag.root(), points);
  return points;
}

// Strays are the 2000th part at either end of an axis, if the rest is much smaller without them.
std::vector<Vec> without_strays(const std::vector<Vec>& points) {
  std::vector<Vec> kept = points;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> along;
    for (const Vec& p : points) along.push_back(p[axis]);
    std::sort(along.begin(), along.end());
    const size_t strays = along.size() / 2000;
    const double low = along[strays], high = along[along.size() - 1 - strays];
    if (high - low > 0.8 * (along.back() - along.front())) continue;
    std::erase_if(kept, [&](const Vec& p) { return p[axis] < low || p[axis] > high; });
  }
  return kept;
}

}  // namespace voxdag::query
