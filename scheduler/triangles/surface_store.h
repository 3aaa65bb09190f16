// Records of surfaces in bins, which are in memory as far as a share of the budget allows and in a
// spill file beyond that. They are gone with the process. Several threads may use a store, each bin
// by one of them at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scheduler/triangles/surface_record.h"
#include "scheduler/triangles/triangle_file.h"

namespace voxdag {

class SurfaceStore {
 public:
  struct Piece {
    std::vector<std::byte> memory;  // empty if the records are in the file
    Extent extent;
  };
  struct Bin {
    std::vector<Piece> pieces;
    uint64_t surfaces = 0;
  };

  // What does not fit `share` goes to a file at `spill_path`, made when it is needed.
  SurfaceStore(FileSystem& files, std::string spill_path, MemoryBudget& share);
  // Removes the file.
  ~SurfaceStore();

  // Adds whole records.
  void add(Bin& bin, std::span<const std::byte> records, uint64_t surfaces);
  // Calls visit(surface) for each. Throws DamagedTriangles.
  template <class Visit>
  void for_each(const Bin& bin, const Visit& visit) const {
    std::vector<std::byte> read;
    for (const Piece& piece : bin.pieces) {
      SurfaceRecords records(bytes_of(piece, read));
      while (const auto surface = records.next()) visit(*surface);
    }
  }
  // Writes to the file what the bins have in memory.
  void move_to_file(std::span<Bin> bins);
  // Frees what the bin has.
  void clear(Bin& bin);
  // Bytes that were written to the file.
  uint64_t file_bytes() const;

 private:
  Extent append_to_file(std::span<const std::byte> records);
  void free_memory(uint64_t bytes);
  std::span<const std::byte> bytes_of(const Piece& piece, std::vector<std::byte>& read) const;

  FileSystem& files_;
  const std::string spill_path_;
  mutable std::mutex mutex_;  // guards all below
  MemoryCharge charge_;
  uint64_t memory_bytes_ = 0;
  std::unique_ptr<TriangleFile> spill_;
};

// Fills bins of a store from one thread, collecting records into larger pieces.
class SurfaceWriter {
 public:
  // The incomplete pieces of all bins take at most about `buffer_bytes`.
  SurfaceWriter(SurfaceStore& store, std::span<SurfaceStore::Bin> bins, size_t buffer_bytes);
  void append(size_t bin, std::span<const std::byte> record);
  // All that was appended is in the bins when this returns.
  void flush();

 private:
  struct Tail {
    std::vector<std::byte> records;
    uint64_t surfaces = 0;
  };

  void hand_on(size_t bin);

  SurfaceStore& store_;
  const std::span<SurfaceStore::Bin> bins_;
  std::vector<Tail> tails_;
  const size_t tail_bytes_;
};

}  // namespace voxdag
