// Measures the speed of hash consing: lookups of bricks and nodes in tables of a given size. The
// lookups are prefetched in batches, as in the tile reducer. Each lookup finds an existing entry.
#include <benchmark/benchmark.h>

#include <random>
#include <vector>

#include "core/dag/consing/brick_table.h"
#include "core/dag/consing/node_table.h"
#include "core/dag/node_hash.h"

namespace voxdag::cpu {
namespace {

constexpr size_t kBatch = 512;

struct Setting {
  MemoryBudget budget{uint64_t{8} << 30};
  PagePool pool;
  PooledMemory memory{budget, pool};
};

// Returns random entry numbers from 1 to `count`, enough for 256 batches.
std::vector<uint64_t> random_entries(uint64_t count) {
  std::mt19937_64 random(2);
  std::vector<uint64_t> out(256 * kBatch);
  for (uint64_t& entry : out) entry = 1 + random() % count;
  return out;
}

void look_up_bricks(benchmark::State& state) {
  const uint64_t count = static_cast<uint64_t>(state.range(0));
  Setting setting;
  BrickTable table(setting.memory);
  table.reserve(count);
  for (uint64_t mask = 1; mask <= count; ++mask) table.find_or_add(mask, hash_brick(mask));
  const auto wanted = random_entries(count);
  uint64_t hashes[kBatch];
  for (auto _ : state)
    for (size_t first = 0; first < wanted.size(); first += kBatch) {
      for (size_t i = 0; i < kBatch; ++i) table.prefetch(hashes[i] = hash_brick(wanted[first + i]));
      for (size_t i = 0; i < kBatch; ++i)
        benchmark::DoNotOptimize(table.find_or_add(wanted[first + i], hashes[i]));
    }
  state.SetItemsProcessed(static_cast<int64_t>(state.iterations() * wanted.size()));
}

// Measures lookups of nodes. Node `n` has the four children n, n + 1, n + 2, n + 3 of the level
// below.
void look_up_nodes(benchmark::State& state) {
  constexpr uint32_t kMask = 0x0f;
  constexpr int kChildren = 4;
  const uint64_t count = static_cast<uint64_t>(state.range(0));
  Setting setting;
  NodeTable table(setting.memory);
  table.reserve(count);
  const auto children_of = [](uint64_t n, uint32_t(&out)[8]) {
    uint64_t hashes[8];
    for (uint32_t i = 0; i < kChildren; ++i) {
      out[i] = static_cast<uint32_t>(n) + i;
      hashes[i] = hash_brick(out[i]);
    }
    return hash_node(kMask, hashes);
  };
  uint32_t children[kBatch][8];
  for (uint64_t n = 1; n <= count; ++n) {
    const uint64_t hash = children_of(n, children[0]);
    table.find_or_add(hash, kMask, children[0], kChildren);
  }
  const auto wanted = random_entries(count);
  uint64_t hashes[kBatch];
  for (auto _ : state)
    for (size_t first = 0; first < wanted.size(); first += kBatch) {
      for (size_t i = 0; i < kBatch; ++i)
        table.prefetch_slot(hashes[i] = children_of(wanted[first + i], children[i]));
      for (const uint64_t hash : hashes) table.prefetch_record(hash);
      for (size_t i = 0; i < kBatch; ++i)
        benchmark::DoNotOptimize(table.find_or_add(hashes[i], kMask, children[i], kChildren));
    }
  state.SetItemsProcessed(static_cast<int64_t>(state.iterations() * wanted.size()));
}

BENCHMARK(look_up_bricks)->Arg(10'000)->Arg(300'000)->Arg(10'000'000);
BENCHMARK(look_up_nodes)->Arg(10'000)->Arg(300'000)->Arg(10'000'000);

}  // namespace
}  // namespace voxdag::cpu
