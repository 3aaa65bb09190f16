#include "scheduler/triangles/record_store.h"

#include <exception>
#include <utility>

namespace voxdag {

RecordStore::RecordStore(FileSystem& files, std::string spill_path, MemoryBudget& share,
                         const std::string& what)
    : files_(files), spill_path_(std::move(spill_path)), charge_(share, 0, what) {}

RecordStore::~RecordStore() {
  if (!spill_) return;
  spill_.reset();
  try {
    files_.remove(spill_path_);
  } catch (const std::exception&) {
    // The remaining file costs space until the work folder is removed.
  }
}

void RecordStore::add(ChunkList& list, std::span<const std::byte> records, uint32_t count) {
  Chunk chunk;
  chunk.records = count;
  std::unique_lock lock(mutex_);
  const uint64_t bytes = records.size() + kChunkListBytes;
  if (charge_.try_resize(memory_bytes_ + bytes)) {
    memory_bytes_ += bytes;
    lock.unlock();
    chunk.memory.assign(records.begin(), records.end());
  } else {
    lock.unlock();
    chunk.extent = append_to_file(records);
  }
  list.add(std::move(chunk));
}

Extent RecordStore::append_to_file(std::span<const std::byte> records) {
  {
    const std::lock_guard lock(mutex_);
    if (!spill_) spill_ = std::make_unique<TriangleFile>(files_, spill_path_);
  }
  return spill_->append(records);
}

std::span<const std::byte> RecordStore::read(const Chunk& chunk,
                                             std::vector<std::byte>& buffer) const {
  if (!chunk.memory.empty()) return chunk.memory;
  buffer.resize(chunk.extent.bytes);
  spill_->read(chunk.extent, buffer);
  return buffer;
}

void RecordStore::move_to_file(std::span<ChunkList> lists) {
  for (ChunkList& list : lists)
    for (Chunk& chunk : list.chunks) {
      if (chunk.memory.empty()) continue;
      chunk.extent = append_to_file(chunk.memory);
      free_memory(std::exchange(chunk.memory, {}).size() + kChunkListBytes);
    }
}

void RecordStore::clear(ChunkList& list) {
  uint64_t bytes = 0;
  for (const Chunk& chunk : list.chunks)
    if (!chunk.memory.empty()) bytes += chunk.memory.size() + kChunkListBytes;
  release_chunks(list, spill_.get());
  list = {};
  free_memory(bytes);
}

void RecordStore::free_memory(uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  memory_bytes_ -= bytes;
  charge_.try_resize(memory_bytes_);
}

const TriangleFile* RecordStore::file() const {
  const std::lock_guard lock(mutex_);
  return spill_.get();
}

uint64_t RecordStore::file_bytes() const {
  const std::lock_guard lock(mutex_);
  return spill_ ? spill_->appended_bytes() : 0;
}

ChunkWriter::ChunkWriter(size_t targets, size_t chunk_bytes, AddChunk add_chunk)
    : chunk_bytes_(chunk_bytes), add_chunk_(std::move(add_chunk)), buffers_(targets) {}

void ChunkWriter::append(size_t target, std::span<const std::byte> records, uint32_t count) {
  Buffer& buffer = buffers_[target];
  buffer.records.insert(buffer.records.end(), records.begin(), records.end());
  buffer.count += count;
  if (buffer.records.size() >= chunk_bytes_) pass_chunk(target);
}

void ChunkWriter::flush() {
  for (size_t target = 0; target < buffers_.size(); ++target)
    if (buffers_[target].count > 0) pass_chunk(target);
}

void ChunkWriter::pass_chunk(size_t target) {
  Buffer& buffer = buffers_[target];
  add_chunk_(target, buffer.records, buffer.count);
  buffer.records.clear();
  buffer.count = 0;
}

}  // namespace voxdag
