// Keeps triangles in memory up to a share of the budget, and further triangles in a spill file. Not
// durable.
// Thread-safe as documented at TriangleStore.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scheduler/triangles/record_store.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

class MemoryStore : public TriangleStore {
 public:
  // Charges chunks to `share`. Chunks that do not fit in `share` are written to a file at
  // `spill_path`, which the first such chunk creates. chunk.h explains `wide`.
  MemoryStore(FileSystem& files, std::string spill_path, bool wide, MemoryBudget& share);

  size_t record_bytes() const override { return record_bytes_; }
  size_t max_chunk_records() const override { return 1024; }
  void add_cube_bins(std::span<const Cube> cubes) override;
  const std::vector<CubeBin>& cube_bins() const override { return cube_bins_; }
  BinId add_part(BinId) override { return add_bin(); }
  void add_chunk(BinId bin, std::span<const std::byte> records) override;
  uint64_t count(BinId bin) const override;
  std::unique_ptr<TriangleStream> open(BinId bin, uint64_t first = 0) const override;
  bool drop(BinId bin) override;
  void retain(BinId bin) override;
  void release(BinId bin) override;
  uint64_t file_bytes() const override;

 private:
  struct Bin {
    ChunkList list;
    uint64_t references = 1;
  };

  BinId add_bin();
  Bin& bin(BinId id) const;

  const size_t record_bytes_;
  std::vector<CubeBin> cube_bins_;
  RecordStore records_;
  mutable std::mutex mutex_;  // guards bins_ and references; the list of a filled bin needs no lock
                              // because it is final
  std::vector<std::unique_ptr<Bin>> bins_;
};

}  // namespace voxdag
