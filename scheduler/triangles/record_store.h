// Stores records of triangles or surfaces in chunks: in memory up to a share of the memory budget,
// and further chunks in a spill file. Not durable.
//
// Several threads may use a store concurrently if each adds to, moves or clears a different list.
// Any number of threads may read a complete list.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scheduler/triangles/chunk.h"
#include "scheduler/triangles/triangle_file.h"

namespace voxdag {

class RecordStore {
 public:
  // Charges chunks to `share`; `what` names the charge in messages. Chunks that do not fit in
  // `share` are written to a file at `spill_path`, which the first such chunk creates.
  RecordStore(FileSystem& files, std::string spill_path, MemoryBudget& share,
              const std::string& what);
  // Removes the spill file.
  ~RecordStore();
  RecordStore(const RecordStore&) = delete;

  // Adds a chunk of `count` records to the list.
  void add(ChunkList& list, std::span<const std::byte> records, uint32_t count);
  // Returns the chunk's records. If they are in the file, reads them into `buffer`. Throws
  // DamagedTriangles if the file is damaged.
  std::span<const std::byte> read(const Chunk& chunk, std::vector<std::byte>& buffer) const;
  // Moves the lists' records from memory to the file.
  void move_to_file(std::span<ChunkList> lists);
  // Frees the list's records and empties the list.
  void clear(ChunkList& list);

  // The spill file; null before the first chunk is written to it.
  const TriangleFile* file() const;
  // Bytes written to the file.
  uint64_t file_bytes() const;

 private:
  Extent append_to_file(std::span<const std::byte> records);
  void free_memory(uint64_t bytes);

  FileSystem& files_;
  const std::string spill_path_;
  mutable std::mutex mutex_;  // guards all members below
  MemoryCharge charge_;
  uint64_t memory_bytes_ = 0;  // bytes of records in memory and of their chunks
  std::unique_ptr<TriangleFile> spill_;
};

// Collects records for several targets into chunks. Used by one thread.
class ChunkWriter {
 public:
  using AddChunk =
      std::function<void(size_t target, std::span<const std::byte> records, uint32_t count)>;

  // Passes a target's records to `add_chunk` as soon as they have `chunk_bytes` or more.
  ChunkWriter(size_t targets, size_t chunk_bytes, AddChunk add_chunk);
  void append(size_t target, std::span<const std::byte> records, uint32_t count);
  // Number of bytes that complete the target's current chunk.
  size_t missing_bytes(size_t target) const {
    return chunk_bytes_ - buffers_[target].records.size();
  }
  // Passes the incomplete chunks to `add_chunk`.
  void flush();

 private:
  struct Buffer {
    std::vector<std::byte> records;
    uint32_t count = 0;
  };

  void pass_chunk(size_t target);

  const size_t chunk_bytes_;
  const AddChunk add_chunk_;
  std::vector<Buffer> buffers_;
};

}  // namespace voxdag
