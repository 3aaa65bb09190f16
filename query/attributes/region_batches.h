// Encodes regions of an attribute section on all threads, and writes them in order. A region has up
// to 64^3 cells of the finest level (docs/format.md, "The color section").
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/parallel_for.h"
#include "core/base/progress.h"
#include "core/color/attributes.h"
#include "core/color/blocks/region.h"
#include "query/attributes/checked_reader.h"
#include "query/attributes/placed_cube.h"

namespace voxdag::query {

// Number of regions that are encoded together before they are written.
inline constexpr size_t kBatchRegions = 32;

// The memory for the regions of a batch and for the threads that encode them, which is charged to
// the budget. `names` is the length of the attribute's list of names.
class RegionMemory {
 public:
  RegionMemory(MemoryBudget& budget, Attribute attribute, uint64_t names, unsigned threads)
      : encoded_(budget, kBatchRegions * encoded_bytes(attribute, names), "encoded colors"),
        workers_(static_cast<unsigned>(std::clamp<uint64_t>(budget.available() / (2 * kWorkerBytes),
                                                            1, std::max(threads, 1u)))),
        work_(budget, workers_ * kWorkerBytes, "the cells of colored regions") {}
  unsigned workers() const { return workers_; }

 private:
  static constexpr uint64_t kMaxRegionCells = uint64_t{1} << 3 * kRegionLevels;
  // Memory of one thread while it encodes a region: the sums of the region's cells and of the next
  // coarser cells (1/8 as many), two colors per cell, and one checksum block.
  static constexpr uint64_t kWorkerBytes =
      kMaxRegionCells * (sizeof(ColoredCell) * 9 / 8 + 2 * sizeof(Color)) +
      CheckedReader::kBlockBytes;
  // Returns an upper bound on the size of an encoded region, in bytes. A color takes half a byte
  // (16 bytes per 32 cells); a value of another attribute takes value_bytes(). The factors are 3/4
  // and 5/4 instead of 1/2 and 1, because a region also has its coarser cells (up to 1/7 as many)
  // and prefixes (docs/format.md).
  static uint64_t encoded_bytes(Attribute attribute, uint64_t names) {
    if (traits_of(attribute).is_color()) return kMaxRegionCells * 3 / 4;
    return kMaxRegionCells * 5 / 4 * value_bytes(attribute, names);
  }

  const MemoryCharge encoded_;
  const unsigned workers_;
  const MemoryCharge work_;
};

template <class Region>
class RegionBatches {
 public:
  // `encode` and `write` are called on any thread: `encode` concurrently, `write` one call at a
  // time and in the order of the calls of add().
  using Encode = std::function<Region(const PlacedCube&)>;
  using Write = std::function<void(const Region&)>;

  RegionBatches(unsigned workers, Progress& progress, Encode encode, Write write)
      : workers_(workers),
        progress_(progress),
        encode_(std::move(encode)),
        write_(std::move(write)) {
    batch_.reserve(kBatchRegions);
  }
  void add(const PlacedCube& cube) {
    batch_.push_back(cube);
    if (batch_.size() == kBatchRegions) flush();
  }
  // Encodes and writes the regions of the current batch. Must be called after the last add().
  void flush() {
    std::vector<Region> regions(batch_.size());
    parallel_for_in_order(
        workers_, batch_.size(), [&](unsigned, size_t i) { regions[i] = encode_(batch_[i]); },
        [&](unsigned, size_t i) {
          write_(regions[i]);
          regions[i] = {};
        });
    progress_.advance(batch_.size());
    batch_.clear();
  }

 private:
  const unsigned workers_;
  Progress& progress_;
  const Encode encode_;
  const Write write_;
  std::vector<PlacedCube> batch_;
};

}  // namespace voxdag::query
