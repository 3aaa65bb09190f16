#include "tests/oracle/solid/rules.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <vector>

#include "tests/oracle/solid/crossing.h"

namespace oracle {
namespace {

using Cell = std::array<int, 3>;

// A connected set of empty voxels that is filled as one unit or not at all, the number of its
// sample points, and the sum of view() over these points.
struct Unit {
  std::vector<Cell> cells;
  int views = 0, points = 0;
};

// The position of a voxel in Morton order, in which x is the most significant axis.
int morton(const Cell& cell) {
  int number = 0;
  for (int bit = 9; bit >= 0; --bit)
    for (int a = 0; a < 3; ++a) number = 2 * number + (cell[a] >> bit & 1);
  return number;
}

template <class Visit>
void for_each_cell(const Cell& low, int edge, Visit visit) {
  for (int x = low[0]; x < low[0] + edge; ++x)
    for (int y = low[1]; y < low[1] + edge; ++y)
      for (int z = low[2]; z < low[2] + edge; ++z) visit(Cell{x, y, z});
}

// Calls visit(cell) for the neighbors of a voxel across its faces.
template <class Visit>
void for_each_neighbor(const Cell& cell, Visit visit) {
  for (int a = 0; a < 3; ++a)
    for (const int step : {-1, 1}) {
      Cell next = cell;
      next[a] += step;
      visit(next);
    }
}

class Filler {
 public:
  Filler(const Triangles& triangles, int edge, SolidRule rule)
      : triangles_(triangles),
        rule_(rule),
        edge_(edge),
        block_(std::min(8, edge)),
        shell_(voxelize(triangles, {{0, 0, 0}, edge})),
        seen_(edge),
        out_{shell_} {}

  Solid run() {
    if (rule_ == SolidRule::kEnclosed) {
      fill_enclosed();
    } else {
      count_rows();
      visit_cube({0, 0, 0}, edge_);
    }
    return out_;
  }

 private:
  bool is_set(const Cell& c) const { return shell_.at(c[0], c[1], c[2]); }
  bool is_empty_cube(const Cell& low, int edge) const {
    bool empty = true;
    for_each_cell(low, edge, [&](const Cell& c) { empty = empty && !is_set(c); });
    return empty;
  }

  // Decides about all empty voxels of a cube. Descends to the maximal empty cubes, each of which is
  // one unit, and to the blocks that contain shell voxels.
  void visit_cube(const Cell& low, int edge) {
    if (is_empty_cube(low, edge)) return decide_cube(low, edge);
    if (edge == block_) return decide_block(low);
    const int half = edge / 2;
    for (int i = 0; i < 8; ++i)
      visit_cube(
          {low[0] + (i & 4 ? half : 0), low[1] + (i & 2 ? half : 0), low[2] + (i & 1 ? half : 0)},
          half);
  }

  static Cell corner(const Cell& low, int edge, int i) {
    return {low[0] + (i & 4 ? edge : 0), low[1] + (i & 2 ? edge : 0), low[2] + (i & 1 ? edge : 0)};
  }

  void decide_cube(const Cell& low, int edge) {
    Unit unit;
    for_each_cell(low, edge, [&](const Cell& c) { unit.cells.push_back(c); });
    for (int i = 0; i < 8; ++i) unit.views += view(corner(low, edge, i));
    unit.points = 8;
    decide(unit);
  }

  void decide_block(const Cell& low) {
    std::vector<Cell> cells;
    for_each_cell(low, block_, [&](const Cell& c) { cells.push_back(c); });
    std::sort(cells.begin(), cells.end(),
              [](const Cell& a, const Cell& b) { return morton(a) < morton(b); });
    for (const Cell& first : cells) {
      if (is_set(first) || seen_.at(first[0], first[1], first[2])) continue;
      Unit unit;
      unit.cells = component(first, low);
      for (int i = 0; i < 8; ++i) {
        const Cell voxel = corner(low, block_ - 1, i);
        if (std::find(unit.cells.begin(), unit.cells.end(), voxel) == unit.cells.end()) continue;
        unit.views += view(corner(low, block_, i));
        ++unit.points;
      }
      if (unit.points == 0) {
        unit.views = view_of_blind(low, first);
        unit.points = 1;
      }
      decide(unit);
    }
  }

  // Returns the empty voxels of a block that are connected with `first`, and marks them as seen.
  std::vector<Cell> component(const Cell& first, const Cell& low) {
    std::vector<Cell> cells = {first};
    seen_.set(first[0], first[1], first[2]);
    for (size_t i = 0; i < cells.size(); ++i)
      for_each_neighbor(Cell(cells[i]), [&](const Cell& next) {
        for (int a = 0; a < 3; ++a)
          if (next[a] < low[a] || next[a] >= low[a] + block_) return;
        if (is_set(next) || seen_.at(next[0], next[1], next[2])) return;
        seen_.set(next[0], next[1], next[2]);
        cells.push_back(next);
      });
    return cells;
  }

  // Returns the sum of six views from a corner of voxels: a ray in each direction of each axis
  // gives the winding number or, for kParity, 1 if it has an odd number of crossings.
  int view(const Cell& at) {
    const auto [known, is_new] = views_.try_emplace(at, 0);
    if (!is_new) return known->second;
    const Point p = {at[0] * kUnits, at[1] * kUnits, at[2] * kUnits};
    int sum = 0;
    for (int a = 0; a < 3; ++a) {
      int left = 0, total = 0, before = 0, all = 0;
      for (const Triangle& t : triangles_) {
        const Crossing crossing = crossing_of(t, p, a);
        if (!crossing.exists) continue;
        total += crossing.sign;
        ++all;
        if (!crossing.is_before) continue;
        left += crossing.sign;
        ++before;
      }
      sum += rule_ == SolidRule::kWinding ? 2 * left - total : before % 2 + (all - before) % 2;
    }
    return known->second = sum;
  }

  // Returns the sum of views for a blind component: a component that contains no voxel at a corner
  // of its block. Starts with view() of the block's low corner, `low`, and follows a path along z,
  // y and x to the center of the component's voxel `first`. For kWinding, each crossing on the path
  // adds 6 times its sign to the sum. For kParity, each crossing replaces the sum s by 6 - s.
  int view_of_blind(const Cell& low, const Cell& first) {
    Point p = {low[0] * kUnits, low[1] * kUnits, low[2] * kUnits};
    int change = 0, crossings = 0;
    for (const int a : {2, 1, 0}) {
      const int64_t length = first[a] * kUnits + kUnits / 2 - p[a];
      for (const Triangle& t : triangles_) {
        const int sign = leg_crossing(t, p, a, length);
        change += sign;
        crossings += sign != 0;
      }
      p[a] += length;
    }
    const int start = view(low);
    if (rule_ == SolidRule::kWinding) return start + 6 * change;
    return crossings % 2 == 0 ? start : 6 - start;
  }

  void decide(const Unit& unit) {
    if (std::abs(unit.views) <= 3 * unit.points) return;
    for (const Cell& c : unit.cells) out_.voxels.set(c[0], c[1], c[2]);
    out_.interior += unit.cells.size();
    if (unit.views % (6 * unit.points) != 0) out_.disputed += unit.cells.size();
  }

  void count_rows() {
    for (int a = 0; a < 3; ++a)
      for (int i = 0; i <= edge_; i += block_)
        for (int j = 0; j <= edge_; j += block_) count_row(a, i, j);
  }
  void count_row(int axis, int i, int j) {
    Point p{};
    p[(axis + 1) % 3] = i * kUnits;
    p[(axis + 2) % 3] = j * kUnits;
    int total = 0, all = 0;
    for (const Triangle& t : triangles_) {
      const Crossing crossing = crossing_of(t, p, axis);
      total += crossing.sign;
      all += crossing.exists;
    }
    out_.rows += all != 0;
    out_.open_rows += total != 0;
    out_.odd_rows += all % 2;
  }

  void fill_enclosed() {
    std::vector<Cell> reached;
    const auto reach = [&](const Cell& c) {
      for (int a = 0; a < 3; ++a)
        if (c[a] < 0 || c[a] >= edge_) return;
      if (is_set(c) || seen_.at(c[0], c[1], c[2])) return;
      seen_.set(c[0], c[1], c[2]);
      reached.push_back(c);
    };
    for_each_cell({0, 0, 0}, edge_, [&](const Cell& c) {
      for (int a = 0; a < 3; ++a)
        if (c[a] == 0 || c[a] == edge_ - 1) return reach(c);
    });
    for (size_t i = 0; i < reached.size(); ++i) for_each_neighbor(Cell(reached[i]), reach);
    for_each_cell({0, 0, 0}, edge_, [&](const Cell& c) {
      if (is_set(c) || seen_.at(c[0], c[1], c[2])) return;
      out_.voxels.set(c[0], c[1], c[2]);
      ++out_.interior;
    });
  }

  const Triangles& triangles_;
  const SolidRule rule_;
  const int edge_, block_;
  const Voxels shell_;
  Voxels seen_;
  Solid out_;
  std::map<Cell, int> views_;
};

// Sets the voxel in which the triangle crosses a row of voxels' centers. `at`: the first voxel of
// the row.
void mark_crossed(const Triangle& t, const Region& region, Cell at, int axis, Voxels& out) {
  Point p;
  for (int a = 0; a < 3; ++a)
    p[a] = (region.low[a] + at[a]) * kUnits + (a == axis ? 0 : kUnits / 2);
  Crossing low = crossing_of(t, p, axis);
  if (!low.exists) return;
  for (; at[axis] < region.edge; ++at[axis]) {
    p[axis] += kUnits;
    const Crossing high = crossing_of(t, p, axis);
    if (!low.is_before && high.is_before) out.set(at[0], at[1], at[2]);
    low = high;
  }
}

}  // namespace

Voxels voxelize_thin(const Triangles& triangles, const Region& region) {
  Voxels out(region.edge);
  for (const Triangle& t : triangles)
    for (int a = 0; a < 3; ++a)
      for (int i = 0; i < region.edge; ++i)
        for (int j = 0; j < region.edge; ++j) {
          Cell first{};
          first[(a + 1) % 3] = i;
          first[(a + 2) % 3] = j;
          mark_crossed(t, region, first, a, out);
        }
  return out;
}

Solid voxelize_solid(const Triangles& triangles, int edge, SolidRule rule) {
  return Filler(triangles, edge, rule).run();
}

}  // namespace oracle
