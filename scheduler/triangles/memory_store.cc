#include "scheduler/triangles/memory_store.h"

#include <utility>

namespace voxdag {

MemoryStore::MemoryStore(FileSystem& files, std::string spill_path, bool wide, MemoryBudget& share)
    : record_bytes_(triangle_record_bytes(wide)),
      records_(files, std::move(spill_path), share, "triangle bins") {
  add_bin();  // the scene's bin
}

void MemoryStore::add_cube_bins(std::span<const Cube> cubes) {
  for (const Cube& cube : cubes) cube_bins_.push_back({cube, add_bin()});
}

BinId MemoryStore::add_bin() {
  std::lock_guard lock(mutex_);
  bins_.push_back(std::make_unique<Bin>());
  return static_cast<BinId>(bins_.size() - 1);
}

MemoryStore::Bin& MemoryStore::bin(BinId id) const {
  std::lock_guard lock(mutex_);
  return *bins_[id];
}

void MemoryStore::add_chunk(BinId id, std::span<const std::byte> records) {
  records_.add(bin(id).list, records, static_cast<uint32_t>(records.size() / record_bytes_));
}

uint64_t MemoryStore::count(BinId id) const { return bin(id).list.records; }

std::unique_ptr<TriangleStream> MemoryStore::open(BinId id, uint64_t first) const {
  return open_chunks(bin(id).list, records_.file(), record_bytes_, first);
}

bool MemoryStore::drop(BinId id) {
  Bin& dropped = bin(id);
  std::lock_guard lock(mutex_);
  records_.clear(dropped.list);
  dropped.references = 0;
  return false;
}

void MemoryStore::retain(BinId id) {
  Bin& retained = bin(id);
  std::lock_guard lock(mutex_);
  ++retained.references;
}

void MemoryStore::release(BinId id) {
  Bin& released = bin(id);
  std::lock_guard lock(mutex_);
  if (released.references > 0 && --released.references == 0) records_.clear(released.list);
}

uint64_t MemoryStore::file_bytes() const { return records_.file_bytes(); }

}  // namespace voxdag
