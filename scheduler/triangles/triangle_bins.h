// Bins of snapped triangles: in memory while the share lasts, in one spill file beyond that. Kept
// bins are in a file of their own from the start, so that another process can go on with them.
//
//   bin -> chunks of up to some thousand records, each in memory or a piece of a file
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
#include "scheduler/triangles/triangle_file.h"

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
  // Reads the bin's triangles from the one of this number on; several streams may be open at once.
  // The bins must outlive it.
  std::unique_ptr<TriangleStream> open(BinId bin, uint64_t first = 0) const;
  // Gives the bin's space back, in memory and on disk. A kept bin stays until it is released.
  void drop(BinId bin);
  // Bytes written to files so far.
  uint64_t spilled_bytes() const;
  size_t record_bytes() const { return record_bytes_; }
  static size_t record_bytes(bool wide);

  // Where kept bins are from now on.
  void keep_in(std::shared_ptr<TriangleFile> file) { kept_file_ = std::move(file); }
  const std::shared_ptr<TriangleFile>& kept_file() const { return kept_file_; }
  BinId add_kept_bin();
  // Writes where the kept bins' chunks are to their file, as a link of a chain: each names the
  // chunks since the one before. Returns the last link.
  Extent write_chain();
  // Fills kept bins, which must be there, with the chunks that a chain names; throws
  // DamagedTriangles.
  void read_chain(const Extent& last);
  // A kept bin is needed by so many more; by one less. Released by the last, its space is given
  // back.
  void hold(BinId bin, uint64_t users);
  void release(BinId bin);

 private:
  friend class BinWriter;
  friend class BinStream;
  struct Chunk {
    std::vector<std::byte> memory;  // empty when in a file
    Extent extent;                  // in that file
    uint32_t triangles = 0;
  };
  // A chunk as a chain names it.
  struct NamedChunk {
    uint32_t bin = 0;
    uint32_t triangles = 0;
    Extent extent;
  };
  // What the list of a bin's chunks takes for one of them, while it grows.
  static constexpr uint64_t kListBytes = 2 * sizeof(Chunk);
  struct Bin {
    std::vector<Chunk> chunks;
    uint64_t triangles = 0;
    bool kept = false;
    uint64_t users = 0;  // of a kept one
  };

  void add_chunk(BinId bin, std::span<const std::byte> records);
  void read_chunk(const Bin& bin, const Chunk& chunk, std::vector<std::byte>& out) const;
  void give_back(Bin& bin);

  FileSystem& files_;
  const std::string spill_path_;
  const size_t record_bytes_;
  MemoryCharge charge_;
  mutable std::mutex mutex_;  // guards all below; chunks of a filled bin no longer change
  std::vector<std::unique_ptr<Bin>> bins_;
  uint64_t memory_bytes_ = 0;  // of records and lists
  std::unique_ptr<TriangleFile> spill_;
  std::shared_ptr<TriangleFile> kept_file_;
  std::vector<NamedChunk> unchained_;  // kept chunks since the last link
  Extent last_link_;
};

// Fills a set of bins from one thread, collecting records into chunks. What was appended is in the
// bins after flush().
class BinWriter {
 public:
  // Chunks are sized so that half-filled ones of all bins together take at most `buffer_bytes`.
  BinWriter(TriangleBins& bins, std::vector<BinId> targets, size_t buffer_bytes);
  // `target` is an index into `targets`.
  void append(size_t target, const FixedTriangle& triangle);
  void flush();

 private:
  TriangleBins& bins_;
  const std::vector<BinId> targets_;
  size_t chunk_bytes_;
  std::vector<std::vector<std::byte>> tails_;
};

}  // namespace voxdag
