// Builds the DAG of a mesh in memory and looks up voxels in it: usage build_mesh OUT.vdag
#include <voxdag/build.h>
#include <voxdag/query.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

namespace {

struct Torus {
  std::vector<float> positions;
  std::vector<uint32_t> indices;
  std::vector<uint8_t> colors;
};

// A torus around the z axis with radii 3 and 1, colored by its angle.
Torus make_torus() {
  constexpr uint32_t kRings = 192, kSides = 96;
  constexpr double kTurn = 6.283185307179586;
  Torus torus;
  for (uint32_t ring = 0; ring < kRings; ++ring)
    for (uint32_t side = 0; side < kSides; ++side) {
      const double a = kTurn * ring / kRings, b = kTurn * side / kSides, r = 3 + std::cos(b);
      for (const double value : {r * std::cos(a), r * std::sin(a), std::sin(b)})
        torus.positions.push_back(static_cast<float>(value));
      for (const uint32_t channel : {255 * ring / kRings, 255 * side / kSides, 128u, 255u})
        torus.colors.push_back(static_cast<uint8_t>(channel));
      const auto vertex = [](uint32_t i, uint32_t j) { return i % kRings * kSides + j % kSides; };
      const uint32_t quad[] = {vertex(ring, side), vertex(ring + 1, side),
                               vertex(ring + 1, side + 1), vertex(ring, side + 1)};
      for (const int corner : {0, 1, 2, 0, 2, 3}) torus.indices.push_back(quad[corner]);
    }
  return torus;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: build_mesh OUT.vdag\n");
    return 2;
  }
  try {
    const Torus torus = make_torus();
    voxdag::BuildOptions options;
    options.mesh = voxdag::Mesh{torus.positions, torus.indices, torus.colors};
    options.resolution = 512;
    options.color = true;
    options.output = argv[1];
    voxdag::BuildHooks hooks;
    hooks.on_warning = [](std::string_view text) {
      std::fprintf(stderr, "warning: %.*s\n", static_cast<int>(text.size()), text.data());
    };
    const voxdag::BuildResult result = voxdag::build(options, hooks);
    std::printf("%s: %llu triangles, %llu voxels, %llu DAG nodes, %llu bytes\n", argv[1],
                static_cast<unsigned long long>(result.triangles),
                static_cast<unsigned long long>(result.voxels),
                static_cast<unsigned long long>(result.dag_nodes),
                static_cast<unsigned long long>(result.bytes));

    // The hole in the middle has no voxel, and the outermost point of the ring has one.
    const voxdag::query::DagFile dag(argv[1]);
    const std::vector<voxdag::query::Position> cells = {
        dag.world_to_cell({0, 0, 0}, dag.grid_levels()),
        dag.world_to_cell({3.9999, 0, 0}, dag.grid_levels())};
    std::vector<uint8_t> set(cells.size());
    dag.lookup(cells, dag.grid_levels(), set);
    std::vector<voxdag::query::Rgba> colors(cells.size());
    dag.colors(cells, dag.grid_levels(), colors);
    std::printf("the middle is %s, the rim is %s with color #%02x%02x%02x\n",
                set[0] ? "set" : "empty", set[1] ? "set" : "empty", colors[1][0], colors[1][1],
                colors[1][2]);
    return 0;
  } catch (const voxdag::Error& error) {
    std::fprintf(stderr, "build_mesh: %s\n", error.what());
    return 1;
  }
}
