// Triangles that outlive the process. The bins of the scene and of the plan's cubes are in a file,
// so that a later run resumes with them. Parts of split subvolumes are not durable: a later run
// copies them again from their source bin. So the source bin is released only after its last part.
//
// The file's table of contents is a chain of links. Each link lists the chunks written since the
// previous link, and the extent of the previous link. checkpoint() appends a link. A caller that
// syncs the file and records the returned state can open the store at that point again.
//
// Thread-safe as documented at TriangleStore. Only the thread that fills the durable bins may call
// checkpoint().
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scheduler/triangles/chunk.h"
#include "scheduler/triangles/memory_store.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

// State from which a store is opened again. A plain value; an empty store has all zeros.
struct DurableStoreState {
  Extent cubes;   // list of the cube bins, which are numbered in this order after the scene's bin
  Extent chunks;  // the last link of the chain
  uint64_t file_end = 0;
};

class DurableStore : public TriangleStore {
 public:
  // Opens the store at `path` with its contents at the checkpoint that returned `state`. Throws
  // DamagedTriangles if they are damaged. Parts are kept in a MemoryStore that charges to `share`
  // and spills to `spill_path`. chunk.h explains `wide`.
  DurableStore(FileSystem& files, std::string path, const DurableStoreState& state,
               std::string spill_path, bool wide, MemoryBudget& share);

  size_t record_bytes() const override { return parts_.record_bytes(); }
  // More records than in a MemoryStore, so that there are fewer chunks to list, read and release.
  size_t max_chunk_records() const override { return 16384; }
  void add_cube_bins(std::span<const Cube> cubes) override;
  const std::vector<CubeBin>& cube_bins() const override { return cube_bins_; }
  BinId add_part(BinId whole) override;
  void add_chunk(BinId bin, std::span<const std::byte> records) override;
  uint64_t count(BinId bin) const override;
  std::unique_ptr<TriangleStream> open(BinId bin, uint64_t first = 0) const override;
  bool drop(BinId bin) override;
  void retain(BinId bin) override;
  void release(BinId bin) override;
  uint64_t file_bytes() const override;

  // Appends the list of new chunks to the file. The returned state is valid after a sync of file().
  DurableStoreState checkpoint();
  // The file, for syncs in the background and for other data that belongs to a checkpoint.
  const std::shared_ptr<TriangleFile>& file() const { return file_; }

 private:
  // A chunk as listed in a link of the chain.
  struct NamedChunk {
    BinId bin = 0;
    uint32_t triangles = 0;
    Extent extent;
  };
  struct Bin {
    ChunkList list;
    uint64_t references = 1;
  };
  // A part's bin id is kFirstPart plus the part's bin id in parts_.
  static constexpr BinId kFirstPart = BinId{1} << 31;

  static bool is_part(BinId bin) { return bin >= kFirstPart; }
  void add_bin() { bins_.push_back(std::make_unique<Bin>()); }
  // Returns the bin itself, or, for a part, the durable bin that it was copied from.
  BinId source_of(BinId bin) const;
  void set_cubes(std::span<const Cube> cubes, const Extent& extent);
  void read_chain();

  MemoryStore parts_;
  const std::shared_ptr<TriangleFile> file_;
  std::vector<CubeBin> cube_bins_;
  Extent cubes_;
  MemoryCharge charge_;       // charge for the lists of chunks
  mutable std::mutex mutex_;  // guards all members below; the list of a filled bin needs no lock
                              // because it is final
  std::vector<std::unique_ptr<Bin>> bins_;
  std::vector<BinId> sources_;  // source bins of the parts, by part number in parts_
  uint64_t list_bytes_ = 0;
  std::vector<NamedChunk> unnamed_;  // chunks since the last link
  Extent last_link_;
};

}  // namespace voxdag
