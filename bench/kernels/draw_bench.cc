// Measures the speed of the rasterizer's two steps: testing which octants of a cube a triangle
// overlaps, and drawing a triangle into a tile.
#include <benchmark/benchmark.h>

#include <memory>
#include <random>
#include <vector>

#include "core/backend/cpu/raster/kernels.h"
#include "core/dag/brick.h"

namespace voxdag::cpu {
namespace {

constexpr size_t kTriangles = 1024;
constexpr int kTileVoxels = 1 << kTileLog2;

// Returns random triangles. The first vertex is in the tile at the origin. Along each axis, the
// second vertex is up to about `edge` voxels from the first, and the third up to about `width`.
std::vector<NarrowTriangle> triangles(int edge, int width) {
  std::mt19937_64 random(1);
  const auto between = [&](int low, int high) {
    const int64_t units = (int64_t{high} - low) * kUnitsPerVoxel;
    return static_cast<int32_t>((low * kUnitsPerVoxel + static_cast<int64_t>(random() % units)) |
                                1);
  };
  std::vector<NarrowTriangle> out(kTriangles + 1);  // kernels read one element beyond the end
  for (NarrowTriangle& t : out)
    for (auto& axis : t.v) {
      axis[0] = between(0, kTileVoxels);
      axis[1] = axis[0] + between(-edge, edge) - 1;
      axis[2] = axis[0] + between(-width, width) - 1;
      axis[1] |= 1;
      axis[2] |= 1;
    }
  return out;
}

void draw(benchmark::State& state, const Kernels* k) {
  if (!k) return state.SkipWithError("not supported by this CPU");
  const auto scene = triangles(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  const auto tile = std::make_unique<TileBricks>();
  std::vector<uint8_t> existing(kTileBlocks / 8);
  std::vector<uint16_t> blocks(kTileBlocks + 1);
  std::vector<uint64_t> keys(kTileBlocks + 1);
  const LatticeCube box{{0, 0, 0}, kTileVoxels * kUnitsPerVoxel};
  int64_t bricks = 0, drawn = 0;
  for (auto _ : state)
    for (size_t i = 0; i < kTriangles; ++i) {
      TileTriangle<int32_t> triangle;
      if (!triangle.set_up(scene[i], false, box)) continue;
      k->draw(triangle, *tile);
      const int count =
          k->list_blocks(*tile, kTileBlocks / 8, existing.data(), blocks.data(), keys.data());
      for (int b = 0; b < count; ++b) {
        uint64_t there[kBlockBricks];
        VoxelBlock& block = tile->blocks[blocks[static_cast<size_t>(b)]];
        bricks += popcount64(k->unpack(block, there).mask);
        block = {};
      }
      ++drawn;
    }
  state.SetItemsProcessed(bricks);
  state.counters["triangles/s"] =
      benchmark::Counter(static_cast<double>(drawn), benchmark::Counter::kIsRate);
}

void test_octants(benchmark::State& state, const Kernels* k) {
  if (!k) return state.SkipWithError("not supported by this CPU");
  const auto scene = triangles(256, 64);
  const LatticeCube box{{0, 0, 0}, kTileVoxels * kUnitsPerVoxel};
  for (auto _ : state)
    for (size_t i = 0; i < kTriangles; ++i)
      benchmark::DoNotOptimize(k->test_octants(scene[i], box, false));
  state.SetItemsProcessed(static_cast<int64_t>(state.iterations() * kTriangles));
}

// The benchmark's items are bricks. The arguments are `edge` and `width` of triangles(): (32, 32)
// as in a scan, (512, 512) as in a wall, and (64, 1) for slivers.
BENCHMARK_CAPTURE(draw, avx512, avx512_kernels())->Args({32, 32})->Args({512, 512})->Args({64, 1});
BENCHMARK_CAPTURE(draw, avx2, avx2_kernels())->Args({32, 32})->Args({512, 512})->Args({64, 1});
BENCHMARK_CAPTURE(draw, portable, &portable_kernels())
    ->Args({32, 32})
    ->Args({512, 512})
    ->Args({64, 1});
// The items of these benchmarks are triangles.
BENCHMARK_CAPTURE(test_octants, avx2, avx2_kernels());
BENCHMARK_CAPTURE(test_octants, portable, &portable_kernels());

}  // namespace
}  // namespace voxdag::cpu
