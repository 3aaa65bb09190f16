// Opens a .vdag file, prints its counts and finds its highest voxel, using only the reader:
//     c++ -std=c++17 -I core/format/global docs/examples/reader_example.cc -o reader_example
//     ./reader_example scene.vdag
#include <cstdio>

#include "voxdag_reader.h"

namespace {

// Skips every subtree below the highest voxel found so far.
struct HighestVoxel {
  explicit HighestVoxel(const voxdag_reader::File& file) : dag(file) {}

  bool node(uint32_t level, int64_t, int64_t y, int64_t, uint64_t) {
    return y + (dag.resolution() >> level) - 1 > highest;
  }
  void brick(int64_t, int64_t y, int64_t, uint64_t mask, uint64_t) {
    for (int64_t dy = 3; dy >= 0 && y + dy > highest; --dy)
      for (int64_t i = 0; i < 16; ++i)
        if (mask >> voxdag_reader::File::brick_bit(i / 4, dy, i % 4) & 1) {
          highest = y + dy;
          return;
        }
  }

  const voxdag_reader::File& dag;
  int64_t highest = -1;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: reader_example FILE.vdag\n");
    return 2;
  }
  try {
    const voxdag_reader::File dag(argv[1]);
    dag.verify_checksums();
    const double voxel_edge = dag.edge() / static_cast<double>(dag.resolution());
    std::printf("%llu voxels of edge %g in %llu nodes\n",
                static_cast<unsigned long long>(dag.voxels()), voxel_edge,
                static_cast<unsigned long long>(dag.dag_nodes()));
    HighestVoxel visitor(dag);
    dag.walk(visitor);
    if (visitor.highest >= 0)
      std::printf("the highest reaches y = %g\n",
                  dag.origin()[1] + static_cast<double>(visitor.highest + 1) * voxel_edge);
    // Level 0 has a single cell, whose attributes summarize the complete scene.
    if (const auto color = dag.color(0, 0, 0, 0))
      std::printf("its mean color is #%02x%02x%02x\n", color->r, color->g, color->b);
    if (const auto normal = dag.normal(0, 0, 0, 0))
      std::printf("its mean normal is %g %g %g\n", static_cast<double>(normal->x),
                  static_cast<double>(normal->y), static_cast<double>(normal->z));
    if (const auto material = dag.material(0, 0, 0, 0))
      std::printf("most of it is '%s'\n", dag.material_names().at(*material).c_str());
    return 0;
  } catch (const voxdag_reader::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
