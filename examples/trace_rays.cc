// Opens a file, draws it with rays, and drops a box onto it: usage trace_rays FILE.vdag
#include <voxdag/query.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <span>
#include <vector>

namespace {

using voxdag::query::Coordinates;
using voxdag::query::DagFile;

// Prints the scene as seen along the z axis, one character per ray. Near voxels are dark, and far
// voxels are light. A ray that hits no voxel prints a blank.
void draw(const DagFile& dag) {
  constexpr int kColumns = 64, kRows = 32;
  const double edge = static_cast<double>(dag.resolution());
  std::vector<Coordinates> origins, directions;
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kColumns; ++column) {
      origins.push_back(
          {(column + 0.5) / kColumns * edge, (1 - (row + 0.5) / kRows) * edge, edge + 1});
      directions.push_back({0, 0, -1});
    }
  std::vector<voxdag::query::RayHit> hits(origins.size());
  dag.rays(origins, directions, {}, hits, 4);
  constexpr char kShades[] = "@%#*+=-:.";
  for (size_t i = 0; i < hits.size(); ++i) {
    const double depth = std::min(hits[i].distance / edge, 1.0);
    std::putchar(hits[i].hit ? kShades[static_cast<int>(depth * 8)] : ' ');
    if (i % kColumns == kColumns - 1) std::putchar('\n');
  }
}

// True if a box of voxels contains a set voxel: the collision test of a game or a planner.
bool collides(const DagFile& dag, const voxdag::query::Region& box) {
  return dag.count({dag.grid_levels(), box}) > 0;
}

// Moves a box down the y axis until it would touch the scene. Returns its height, or -1 if it never
// touches.
int64_t drop_box(const DagFile& dag, int64_t x, int64_t z, int64_t size) {
  for (int64_t y = dag.resolution(); y >= 0; --y)
    if (collides(dag, {{x, y - 1, z}, {x + size, y - 1 + size, z + size}})) return y;
  return -1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: trace_rays FILE.vdag\n");
    return 2;
  }
  try {
    const DagFile dag(argv[1]);
    std::printf("%lld voxels per edge, %llu set\n", static_cast<long long>(dag.resolution()),
                static_cast<unsigned long long>(dag.voxels()));
    draw(dag);
    const int64_t size = std::max<int64_t>(1, dag.resolution() / 16);
    const int64_t middle = (dag.resolution() - size) / 2;
    std::printf("a box of %lld voxels comes to rest at y = %lld\n", static_cast<long long>(size),
                static_cast<long long>(drop_box(dag, middle, middle, size)));
    return 0;
  } catch (const voxdag::Error& error) {
    std::fprintf(stderr, "trace_rays: %s\n", error.what());
    return 1;
  }
}
