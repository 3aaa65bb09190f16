#include "bench/query/query_set.h"

#include <time.h>

#include <bit>
#include <random>

#include "query/dag/dag_view.h"
#include "query/render/views.h"

namespace voxdag::query {
namespace {

// Returns a set cell, found by choosing random children from the root down. So the set octants of a
// node are equally likely, however many cells they contain.
Position random_set_cell(const DagView& dag, uint32_t grid_levels, std::mt19937_64& random) {
  Position p{};
  uint64_t content = dag.root();
  for (uint32_t depth = 0; depth < grid_levels; ++depth) {
    const DagView::Children children = dag.children(depth, content);
    int index;
    do index = static_cast<int>(random() % 8);
    while (!children.has(index));
    for (size_t axis = 0; axis < 3; ++axis) p[axis] = 2 * p[axis] + (index >> (2 - axis) & 1);
    content = dag.content(depth, children, index);
  }
  return p;
}

double seconds_of(clockid_t clock) {
  timespec t;
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace

double thread_seconds() { return seconds_of(CLOCK_THREAD_CPUTIME_ID); }
double process_seconds() { return seconds_of(CLOCK_PROCESS_CPUTIME_ID); }

Region box_around(const QuerySet& queries, size_t i) {
  Region box;
  for (size_t axis = 0; axis < 3; ++axis) {
    box.low[axis] = queries.set_cells[i][axis] - kBoxEdge / 2;
    box.high[axis] = box.low[axis] + kBoxEdge;
  }
  return box;
}

QuerySet make_queries(const DagFile& dag, uint32_t grid_levels, size_t points, int picture_edge) {
  const DagView view(dag.file());
  QuerySet queries;
  std::mt19937_64 random(1);
  const uint64_t edge = uint64_t{1} << grid_levels;
  const auto anywhere = [&] { return static_cast<int64_t>(random() % edge); };
  for (size_t i = 0; i < points; ++i) {
    queries.uniform.push_back({anywhere(), anywhere(), anywhere()});
    queries.set_cells.push_back(random_set_cell(view, grid_levels, random));
  }
  const Camera camera(named_view("auto", view, 1, {}), picture_edge, picture_edge);
  const double scale = static_cast<double>(edge) / static_cast<double>(view.resolution());
  for (int tile = 0; tile < picture_edge * picture_edge / 64; ++tile)
    for (int i = 0; i < 64; ++i) {
      const int x = tile % (picture_edge / 8) * 8 + i % 8,
                y = tile / (picture_edge / 8) * 8 + i / 8;
      const Ray ray = camera.ray(x + 0.5, y + 0.5);
      queries.origins.push_back(
          {ray.origin[0] * scale, ray.origin[1] * scale, ray.origin[2] * scale});
      queries.directions.push_back({ray.direction[0], ray.direction[1], ray.direction[2]});
    }
  return queries;
}

}  // namespace voxdag::query
