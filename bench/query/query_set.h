// What is asked of a file in the benchmarks: the same points and rays for every library.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "query/lookup/dag.h"

namespace voxdag::query {

struct QuerySet {
  std::vector<Position> uniform;                 // points of the grid
  std::vector<Position> set_cells;               // random set cells
  std::vector<Coordinates> origins, directions;  // of a picture's pixels, in tiles of 8 x 8
};

// `points` of each kind in the grid of 2^grid_levels, and the rays through the pixels of a square
// picture, in cells of that grid, for the placement that `voxdag render` would choose.
QuerySet make_queries(const Dag& dag, uint32_t grid_levels, size_t points, int picture_edge);

// What a benchmark found, so that libraries can be compared, and its speed.
struct Timing {
  double per_second = 0;
  uint64_t found = 0;
};

// CPU time of this thread.
double thread_seconds();

// The best of three runs by CPU time of this thread; run() returns what it found.
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

}  // namespace voxdag::query
