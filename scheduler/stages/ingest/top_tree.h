// The dense top tree. For every cell of a coarse level it counts the triangles that touch the cell,
// and sums the cell's shares of the expected work of these triangles. These counters decide which
// cubes of the grid become subvolumes. Threads fill separate tallies, which are added to the tree
// one after another.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/geometry/cube.h"
#include "core/geometry/fixed_triangle.h"
#include "core/geometry/grid.h"
#include "core/geometry/octree_descent.h"

namespace voxdag {

// Expected number of voxels and bricks that a triangle touches. The number of bricks is the volume
// of the Minkowski sum of the triangle and a brick: area * (|nx| + |ny| + |nz|) + the extents along
// the axes + 1. Here n is the unit normal, and lengths are in bricks. The number of voxels is the
// same sum with lengths in voxels.
struct ExpectedWork {
  double voxels, bricks;
};
ExpectedWork expected_work(const SnappedTriangle& triangle);

struct SubvolumePlan {
  Cube cube;
  double weight = 0;       // expected bricks; each triangle divides its bricks among its cells
  uint64_t triangles = 0;  // upper bound of the triangles that touch the cube
};

// Maximum weight and edge of subvolumes.
struct SubvolumeLimits {
  // A subvolume is *flat* if its triangles have at least this weight on average. Large triangles
  // make many equal nodes, so the tables of a flat subvolume are small for its weight.
  static constexpr double kFlatTriangleBricks = 256;

  double weight = 0;
  double flat_weight = 0;  // maximum weight of flat subvolumes, if larger than `weight`
  int64_t edge = INT64_MAX;

  bool allow(const SubvolumePlan& s, int64_t edge_voxels) const {
    const bool is_flat = s.weight >= kFlatTriangleBricks * static_cast<double>(s.triangles);
    return edge_voxels <= edge && s.weight <= (is_flat ? std::max(weight, flat_weight) : weight);
  }
};

class TopTree {
 public:
  static constexpr uint32_t kMaxDepth = 7;  // 128^3 cells

  // Makes a tree with cells of level `depth`, at most kMaxDepth. A cell is at least as large as the
  // smallest subvolume. The counters are charged to `budget`.
  TopTree(uint32_t grid_levels, MemoryBudget& budget, uint32_t depth);
  // Returns the depth of the deepest tree whose counters take at most `bytes`.
  static uint32_t depth_within(uint32_t grid_levels, uint64_t bytes);

  // The contributions of some triangles to the cells of a tree. Not thread-safe.
  class Tally {
   public:
    explicit Tally(const TopTree& top) : grid_levels_(top.grid_levels_), depth_(top.depth_) {}
    void clear();
    // Adds a triangle. `weight` is the number of bricks that the triangle is expected to touch.
    void add(const FixedTriangle& triangle, double weight);

   private:
    friend class TopTree;
    static constexpr size_t kSlots = 256;
    static constexpr size_t kMaxTouched = 8;
    struct Entry {
      uint64_t code = 0;
      float weight = 0;
      uint32_t triangles = 0;
    };
    struct LargeTriangle {
      FixedTriangle triangle;
      double weight;
    };

    // Sets touched_ to the cells that the triangle touches.
    void find_touched(const FixedTriangle& triangle);
    void collect(const FixedTriangle& triangle, const Cube& cube, uint64_t code);
    void remember_cell(const FixedTriangle& triangle);

    const uint32_t grid_levels_;
    const uint32_t depth_;
    std::vector<Entry> entries_;                 // a cell can have several entries
    std::vector<LargeTriangle> large_;           // triangles that touch more than kMaxTouched cells
    std::array<uint32_t, kSlots> last_entry_{};  // by code % kSlots: index of the last such entry
    std::vector<uint64_t> touched_;              // cells that the last triangle touches
    // The cell of the most recent triangle that lies in a single cell. add() tests this cell first.
    CubeInside last_cell_;
    size_t entry_of_last_cell_ = 0;
  };
  void add(Tally& tally);
  double total_weight() const { return total_weight_; }
  // Returns the counters as plain bytes, without the total weight.
  std::span<const std::byte> cells() const {
    return std::as_bytes(std::span(cells_.data(), cells_.size()));
  }
  // Sets the total weight and returns the memory of the counters. The caller fills it with the
  // cells() of a tree of the same depth.
  std::span<std::byte> fill(double total_weight) {
    total_weight_ = total_weight;
    return std::as_writable_bytes(std::span(cells_.data(), cells_.size()));
  }
  uint64_t occupied_cells() const;

  // Returns the largest occupied cubes within the limits, in Morton order. Includes single cells
  // that exceed a limit, which cannot be divided.
  std::vector<SubvolumePlan> subvolumes_by_weight(const SubvolumeLimits& limits) const;
  // Returns the occupied cubes of this edge (or of the cells' edge if that is larger), in Morton
  // order.
  std::vector<SubvolumePlan> subvolumes_by_edge(int64_t edge_voxels) const;

 private:
  struct Cell {
    float weight = 0;
    uint32_t triangles = 0;
  };

  // Most of the grid is empty, so gather() first tests cubes this many levels above the cells.
  static constexpr uint32_t kSkippedLevels = 2;
  bool is_empty(uint64_t code) const;
  template <class IsSmallEnough>
  SubvolumePlan gather(const Cube& cube, uint64_t code, const IsSmallEnough& is_small_enough,
                       std::vector<SubvolumePlan>& out) const;

  const uint32_t grid_levels_;
  const uint32_t depth_;
  PageBuffer<Cell> cells_;  // indexed by Morton code
  double total_weight_ = 0;
};

}  // namespace voxdag
