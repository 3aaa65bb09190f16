// Holds a build's snapped triangles from ingest until their subvolumes are built. The triangles are
// in bins: one for the scene, then one for each cube of the plan, then one for each part of a split
// subvolume. MemoryStore holds them for this process, DurableStore also for later processes.
//
// Life of a bin:
//   1. It is created with one reference, and filled by one BinWriter.
//   2. Any number of streams read it.
//   3. drop(): this run does not read the bin again. A MemoryStore frees the bin; a DurableStore
//      keeps it for later runs unless it is a part.
//   4. release(): the artifact built from the bin is durable. The last release() frees the bin.
//
// Thread-safe, except that add_cube_bins() needs exclusive access and that a bin must not be filled
// and read concurrently.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/backend/backend.h"
#include "core/geometry/cube.h"
#include "scheduler/triangles/record_store.h"

namespace voxdag {

using BinId = uint32_t;

// The bin of all triangles, in the scene's order. It exists in every store.
inline constexpr BinId kSceneBin = 0;

// The bin of the triangles that touch a cube.
struct CubeBin {
  Cube cube;
  BinId bin = 0;
};

class TriangleStore {
 public:
  virtual ~TriangleStore() = default;

  virtual size_t record_bytes() const = 0;
  // Maximum number of records that a caller should pass to add_chunk().
  virtual size_t max_chunk_records() const = 0;

  // Creates the bins of the plan's cubes. Must not be called if the store has them already, because
  // an earlier run created them.
  virtual void add_cube_bins(std::span<const Cube> cubes) = 0;
  virtual const std::vector<CubeBin>& cube_bins() const = 0;
  // Creates a bin for a part of a split subvolume. The caller copies triangles from the bin `whole`
  // to it. A DurableStore retains `whole` until the part is released.
  virtual BinId add_part(BinId whole) = 0;

  virtual void add_chunk(BinId bin, std::span<const std::byte> records) = 0;
  virtual uint64_t count(BinId bin) const = 0;
  // Reads the bin's triangles, starting at index `first`. The store must outlive the stream.
  virtual std::unique_ptr<TriangleStream> open(BinId bin, uint64_t first = 0) const = 0;

  // Call it when this run does not read the bin again. Returns true if references remain. The
  // caller must then call release() when the bin's artifact is durable.
  virtual bool drop(BinId bin) = 0;
  // Adds one reference.
  virtual void retain(BinId bin) = 0;
  // Removes one reference. Does nothing for a bin that drop() has freed.
  virtual void release(BinId bin) = 0;

  // Bytes that this run wrote to files.
  virtual uint64_t file_bytes() const = 0;
};

// Adds records to a bin, in chunks of the store's size.
void add_records(TriangleStore& store, BinId bin, std::span<const std::byte> records);

// Fills a set of bins from one thread and collects triangles into chunks.
class BinWriter {
 public:
  // Chooses the chunk size so that the incomplete chunks of all bins together take at most about
  // `buffer_bytes`.
  BinWriter(TriangleStore& store, std::vector<BinId> targets, size_t buffer_bytes);
  // Adds triangles or records to a bin. `target` is an index into the constructor's `targets`.
  void append(size_t target, const FixedTriangle& triangle);
  void append(size_t target, std::span<const std::byte> records);
  // Adds the buffered records to the bins.
  void flush() { writer_.flush(); }

 private:
  const size_t record_bytes_;
  ChunkWriter writer_;
};

}  // namespace voxdag
