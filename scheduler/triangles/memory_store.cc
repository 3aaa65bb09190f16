#include "scheduler/triangles/memory_store.h"

namespace voxdag {

MemoryStore::MemoryStore(FileSystem& files, std::string spill_path, bool wide, MemoryBudget& share)
    : files_(files),
      spill_path_(std::move(spill_path)),
      record_bytes_(triangle_record_bytes(wide)),
      charge_(share, 0, "triangle bins") {
  add_bin();  // The scene's.
}

void MemoryStore::add_cube_bins(std::span<const Cube> cubes) {
  for (const Cube& cube : cubes) cube_bins_.push_back({cube, add_bin()});
}

BinId MemoryStore::add_bin() {
  std::lock_guard lock(mutex_);
  bins_.push_back(std::make_unique<Bin>());
  return static_cast<BinId>(bins_.size() - 1);
}

void MemoryStore::add_chunk(BinId bin, std::span<const std::byte> records) {
  Chunk chunk;
  chunk.triangles = static_cast<uint32_t>(records.size() / record_bytes_);
  std::unique_lock lock(mutex_);
  Bin& target = *bins_[bin];
  memory_bytes_ += kChunkListBytes;
  if (charge_.try_resize(memory_bytes_ + records.size())) {
    memory_bytes_ += records.size();
    chunk.memory.assign(records.begin(), records.end());
  } else {
    // Where not even the list fits, it goes uncharged: it is small compared to what is spilled.
    charge_.try_resize(memory_bytes_);
    if (!spill_) spill_ = std::make_unique<TriangleFile>(files_, spill_path_);
    lock.unlock();
    chunk.extent = spill_->append(records);
    lock.lock();
  }
  target.list.add(std::move(chunk));
}

uint64_t MemoryStore::count(BinId bin) const {
  std::lock_guard lock(mutex_);
  return bins_[bin]->list.triangles;
}

std::unique_ptr<TriangleStream> MemoryStore::open(BinId bin, uint64_t first) const {
  std::lock_guard lock(mutex_);
  return open_chunks(bins_[bin]->list, spill_.get(), record_bytes_, first);
}

bool MemoryStore::drop(BinId bin) {
  std::lock_guard lock(mutex_);
  free(*bins_[bin]);
  return false;
}

void MemoryStore::retain(BinId bin) {
  std::lock_guard lock(mutex_);
  ++bins_[bin]->references;
}

void MemoryStore::release(BinId bin) {
  std::lock_guard lock(mutex_);
  Bin& released = *bins_[bin];
  if (released.references > 0 && --released.references == 0) free(released);
}

void MemoryStore::free(Bin& bin) {
  for (const Chunk& chunk : bin.list.chunks) memory_bytes_ -= chunk.memory.size() + kChunkListBytes;
  release_chunks(bin.list, spill_.get());
  bin.list = {};
  bin.references = 0;
  charge_.try_resize(memory_bytes_);
}

uint64_t MemoryStore::file_bytes() const {
  std::lock_guard lock(mutex_);
  return spill_ ? spill_->appended_bytes() : 0;
}

}  // namespace voxdag
