#include "scheduler/triangles/surface_store.h"

#include <algorithm>
#include <exception>
#include <utility>

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
    lock.unlock();
    piece.extent = append_to_file(records);
  }
  bin.pieces.push_back(std::move(piece));
  bin.surfaces += surfaces;
}

Extent SurfaceStore::append_to_file(std::span<const std::byte> records) {
  {
    const std::lock_guard lock(mutex_);
    if (!spill_) spill_ = std::make_unique<TriangleFile>(files_, spill_path_);
  }
  return spill_->append(records);
}

void SurfaceStore::move_to_file(std::span<Bin> bins) {
  for (Bin& bin : bins)
    for (Piece& piece : bin.pieces) {
      if (piece.memory.empty()) continue;
      piece.extent = append_to_file(piece.memory);
      free_memory(std::exchange(piece.memory, {}).size() + sizeof(Piece));
    }
}

std::span<const std::byte> SurfaceStore::bytes_of(const Piece& piece,
                                                  std::vector<std::byte>& read) const {
  if (!piece.memory.empty()) return piece.memory;
  read.resize(piece.extent.bytes);
  spill_->read(piece.extent, read);
  return read;
}

void SurfaceStore::clear(Bin& bin) {
  uint64_t bytes = 0;
  for (const Piece& piece : bin.pieces) {
    if (piece.memory.empty())
      spill_->release(piece.extent);
    else
      bytes += piece.memory.size() + sizeof(Piece);
  }
  bin = {};
  free_memory(bytes);
}

void SurfaceStore::free_memory(uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  memory_bytes_ -= bytes;
  charge_.try_resize(memory_bytes_);
}

uint64_t SurfaceStore::file_bytes() const {
  const std::lock_guard lock(mutex_);
  return spill_ ? spill_->appended_bytes() : 0;
}

SurfaceWriter::SurfaceWriter(SurfaceStore& store, std::span<SurfaceStore::Bin> bins,
                             size_t buffer_bytes)
    : store_(store),
      bins_(bins),
      tails_(bins.size()),
      tail_bytes_(std::clamp<size_t>(buffer_bytes / bins.size(), 2048, 64 << 10)) {}

void SurfaceWriter::append(size_t bin, std::span<const std::byte> record) {
  Tail& tail = tails_[bin];
  tail.records.insert(tail.records.end(), record.begin(), record.end());
  ++tail.surfaces;
  if (tail.records.size() >= tail_bytes_) hand_on(bin);
}

void SurfaceWriter::flush() {
  for (size_t bin = 0; bin < tails_.size(); ++bin)
    if (tails_[bin].surfaces > 0) hand_on(bin);
}

void SurfaceWriter::hand_on(size_t bin) {
  Tail& tail = tails_[bin];
  store_.add(bins_[bin], tail.records, tail.surfaces);
  tail.records.clear();
  tail.surfaces = 0;
}

}  // namespace voxdag
