// The queries of the benchmarks: the same points and rays for every library.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "voxdag/query.h"

namespace voxdag::query {

struct QuerySet {
  std::vector<Position> uniform;                 // points of the grid
  std::vector<Position> set_cells;               // random set cells
  std::vector<Coordinates> origins, directions;  // of a picture's pixels, in tiles of 8 x 8
};

// Boxes of 64^3 cells around the first set cells. Boxes at the edge of the grid extend beyond it.
inline constexpr size_t kBoxes = 2000;
inline constexpr int64_t kBoxEdge = 64;
Region box_around(const QuerySet& queries, size_t i);

// Returns `points` points of each kind in the grid of 2^grid_levels, and the rays through the
// pixels of a square picture, in cells of this grid. The camera is at the placement that `voxdag
// render` would choose.
QuerySet make_queries(const DagFile& dag, uint32_t grid_levels, size_t points, int picture_edge);

// The result of a benchmark, so that libraries can be compared, and its speed.
struct Timing {
  double per_second = 0;
  uint64_t found = 0;
};

// The measurements of one library. `found` is, for lookups and rays, the number of them with a set
// cell, and for dense boxes and counts, the number of all set cells.
struct Timings {
  Timing uniform, set_cells, rays, boxes, counts;
};

// CPU time of this thread.
double thread_seconds();

// Returns the best of three runs by CPU time of this thread, with the result of run().
template <class Run>
Timing best_of_three(size_t items, const Run& run) {
  Timing best;
  for (int i = 0; i < 3; ++i) {
    const double start = thread_seconds();
    best.found = run();
    best.per_second =
        std::max(best.per_second, static_cast<double>(items) / (thread_seconds() - start));
  }
  return best;
}

// Runs over kBoxes boxes: make_box(i) fills `cells` with box i, z fastest.
template <class MakeBox>
Timing measure_boxes(const std::vector<uint8_t>& cells, const MakeBox& make_box) {
  Timing timing = best_of_three(kBoxes, [&] {
    for (size_t i = 0; i < kBoxes; ++i) make_box(i);
    return uint64_t{0};
  });
  for (size_t i = 0; i < kBoxes; ++i) {
    make_box(i);
    for (const uint8_t cell : cells) timing.found += cell;
  }
  return timing;
}

}  // namespace voxdag::query
