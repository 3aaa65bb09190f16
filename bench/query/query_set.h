// The queries of the benchmarks: the same points and rays for every library.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "voxdag/query.h"

namespace voxdag::query {

struct RaySet {
  std::vector<Coordinates> origins, directions;  // unit vectors as directions
};

struct QuerySet {
  std::vector<Position> uniform;                 // random points, uniform in the grid
  std::vector<Position> set_cells;               // random set cells
  std::vector<Coordinates> origins, directions;  // rays of a picture, tile by tile (8 x 8 pixels)
};

// Number of boxes, and their edge in cells. box_around() returns box i, which is centered on the
// i-th set cell of the queries. A box near the border of the grid extends beyond the grid.
inline constexpr size_t kBoxes = 2000;
inline constexpr int64_t kBoxEdge = 64;
Region box_around(const QuerySet& queries, size_t i);

// Makes queries for the grid of 2^grid_levels cells per edge: `points` uniform points, `points` set
// cells, and the rays through the pixels of a square picture. Positions are in cells of this grid.
// The camera has the position that `voxdag render` would choose.
QuerySet make_queries(const DagFile& dag, uint32_t grid_levels, size_t points, int picture_edge);

// The speed of a benchmark in items per second, and a result to compare between libraries.
struct Timing {
  double per_second = 0;
  uint64_t found = 0;
};

// The measurements of one library. For lookups and rays, `found` is the number of points or rays
// with a set cell. For dense boxes and counts, it is the total number of set cells.
struct Timings {
  Timing uniform, set_cells, rays, boxes, counts;
};

// Returns the CPU time of the calling thread, and of all threads of the process, in seconds.
double thread_seconds();
double process_seconds();

// Calls run() three times. Returns the highest speed, in `items` per second of CPU time of this
// thread, and the result of run().
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

// Measures make_box(i) for the kBoxes boxes. make_box(i) writes box i to `cells`, z fastest. The
// result's `found` is the number of set cells in all boxes.
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
