#include "scheduler/color/surface_store.h"

#include <exception>

namespace voxdag {

SurfaceStore::SurfaceStore(FileSystem& files, std::string spill_path, MemoryBudget& share)
    : files_(files), spill_path_(std::move(spill_path)), charge_(share, 0, "surfaces") {}

SurfaceStore::~SurfaceStore() {
  if (!spill_) return;
  spill_.reset();
  try {
    files_.remove(spill_path_);
  } catch (const std::exception&) {
    // It costs space until the work folder is removed.
  }
}

void SurfaceStore::add(Bin& bin, std::span<const std::byte> records, uint64_t surfaces) {
  Piece piece;
  std::unique_lock lock(mutex_);
  const uint64_t bytes = records.size() + sizeof(Piece);
  if (charge_.try_resize(memory_bytes_ + bytes)) {
    memory_bytes_ += bytes;
    lock.unlock();
    piece.memory.assign(records.begin(), records.end());
  } else {
    if (!spill_) spill_ = std::make_unique<TriangleFile>(files_, spill_path_);
    lock.unlock();
    piece.extent = spill_->append(records);
  }
  bin.pieces.push_back(std::move(piece));
  bin.surfaces += surfaces;
}

std::span<const std::byte> SurfaceStore::bytes_of(const Piece& piece,
                                                  std::vector<std::byte>& read) const {
  if (!piece.memory.empty()) return piece.memory;
  read.resize(piece.extent.bytes);
  spill_->read(piece.extent, read);
  return read;
}

void SurfaceStore::clear(Bin& bin) {
  for (const Piece& piece : bin.pieces)
    if (piece.memory.empty()) spill_->release(piece.extent);
  uint64_t bytes = 0;
  for (const Piece& piece : bin.pieces)
    if (!piece.memory.empty()) bytes += piece.memory.size() + sizeof(Piece);
  bin = {};
  const std::lock_guard lock(mutex_);
  memory_bytes_ -= bytes;
  charge_.try_resize(memory_bytes_);
}

uint64_t SurfaceStore::file_bytes() const {
  const std::lock_guard lock(mutex_);
  return spill_ ? spill_->appended_bytes() : 0;
}

}  // namespace voxdag
