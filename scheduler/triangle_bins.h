// Bins of snapped triangles: in memory while the share lasts, in one spill file beyond that.
//
//   bin -> chunks of up to some hundred records, each in memory or at an offset of the spill file
//
// A record is nine coordinates: 32-bit ones (36 bytes) unless the grid was given by hand, so that
// triangles may reach far outside of it (64-bit, 72 bytes). Bins are filled through BinWriters, one
// a thread; a bin is read or dropped by whoever owns it, after it was filled. Thread-safe in that
// sense.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/backend/backend.h"
#include "core/base/memory_budget.h"
#include "core/io/file_system.h"

namespace voxdag {

using BinId = uint32_t;

class TriangleBins {
 public:
  // Chunks are charged to `share`; what it refuses goes to a file at `spill_path`, created when
  // needed.
  TriangleBins(FileSystem& files, std::string spill_path, bool wide, MemoryBudget& share);
  ~TriangleBins();

  BinId add_bin();
  uint64_t count(BinId bin) const;
  // Reads the bin's triangles; several streams may be open at once. The bins must outlive it.
  std::unique_ptr<TriangleStream> open(BinId bin) const;
  // Gives the bin's memory back.
  void drop(BinId bin);
  // Bytes written to the spill file so far.
  uint64_t spilled_bytes() const;
  size_t record_bytes() const { return record_bytes_; }

 private:
  friend class BinWriter;
  friend class BinStream;
  struct Chunk {
    std::vector<std::byte> memory;  // empty when spilled
    uint64_t offset = 0;            // in the spill file
    uint64_t checksum = 0;          // of the spilled records
    uint32_t triangles = 0;
  };
  // What the list of a bin's chunks takes for one of them, while it grows.
  static constexpr uint64_t kListBytes = 2 * sizeof(Chunk);
  struct Bin {
    std::vector<Chunk> chunks;
    uint64_t triangles = 0;
  };

  void add_chunk(BinId bin, std::span<const std::byte> records);
  void read_chunk(const Chunk& chunk, std::vector<std::byte>& out) const;

  FileSystem& files_;
  const std::string spill_path_;
  const size_t record_bytes_;
  MemoryCharge charge_;
  mutable std::mutex mutex_;  // guards all below; chunks of a filled bin no longer change
  std::vector<std::unique_ptr<Bin>> bins_;
  uint64_t memory_bytes_ = 0;  // of records and lists
  uint64_t spilled_bytes_ = 0;
  std::unique_ptr<WritableFile> spill_writer_;
  std::unique_ptr<ReadableFile> spill_reader_;
};

// Fills a set of bins from one thread, collecting records into chunks. What was appended is in the
// bins after finish().
class BinWriter {
 public:
  // Chunks are sized so that half-filled ones of all bins together take at most `buffer_bytes`.
  BinWriter(TriangleBins& bins, std::vector<BinId> targets, size_t buffer_bytes);
  // `target` is an index into `targets`.
  void append(size_t target, const FixedTriangle& triangle);
  void finish();

 private:
  TriangleBins& bins_;
  const std::vector<BinId> targets_;
  size_t chunk_bytes_;
  std::vector<std::vector<std::byte>> tails_;
};

}  // namespace voxdag
