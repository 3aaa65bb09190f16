#include "scheduler/triangles/durable_store.h"

#include <algorithm>
#include <cstring>

namespace voxdag {

DurableStore::DurableStore(FileSystem& files, std::string path, const DurableStoreState& state,
                           std::string spill_path, bool wide, MemoryBudget& share)
    : parts_(files, std::move(spill_path), wide, share),
      file_(std::make_shared<TriangleFile>(files, std::move(path), state.file_end)),
      charge_(share, 0, "lists of triangle bins"),
      last_link_(state.chunks) {
  add_bin();  // the scene's bin
  std::vector<Cube> cubes(state.cubes.bytes / sizeof(Cube));
  if (!cubes.empty()) file_->read(state.cubes, std::as_writable_bytes(std::span(cubes)));
  set_cubes(cubes, state.cubes);
  read_chain();
}

void DurableStore::add_cube_bins(std::span<const Cube> cubes) {
  set_cubes(cubes, file_->append(std::as_bytes(cubes)));
}

void DurableStore::set_cubes(std::span<const Cube> cubes, const Extent& extent) {
  std::lock_guard lock(mutex_);
  cubes_ = extent;
  for (const Cube& cube : cubes) {
    cube_bins_.push_back({cube, static_cast<BinId>(bins_.size())});
    add_bin();
  }
}

void DurableStore::read_chain() {
  for (Extent at = last_link_; at.bytes;) {
    std::vector<std::byte> link(at.bytes);
    file_->read(at, link);
    std::memcpy(&at, link.data(), sizeof at);
    for (size_t i = sizeof at; i < link.size(); i += sizeof(NamedChunk)) {
      NamedChunk chunk;
      std::memcpy(&chunk, link.data() + i, sizeof chunk);
      if (chunk.bin >= bins_.size())
        throw DamagedTriangles("the stored triangles name bin " + std::to_string(chunk.bin) +
                               ": expected less than " + std::to_string(bins_.size()) +
                               ", the number of bins");
      bins_[chunk.bin]->list.add({.extent = chunk.extent, .records = chunk.triangles});
      list_bytes_ += kChunkListBytes;
    }
  }
  // The chain begins with the newest link, but chunks are read in the order in which they were
  // written.
  for (const auto& bin : bins_) bin->list.sort_by_offset();
  charge_.try_resize(list_bytes_);
}

// Appends a link to the chain if chunks were added. The link contains the extent of the previous
// link and the chunks added since then.
DurableStoreState DurableStore::checkpoint() {
  if (!unnamed_.empty()) {
    std::vector<std::byte> link(sizeof last_link_ + unnamed_.size() * sizeof(NamedChunk));
    std::memcpy(link.data(), &last_link_, sizeof last_link_);
    std::memcpy(link.data() + sizeof last_link_, unnamed_.data(), link.size() - sizeof last_link_);
    last_link_ = file_->append(link);
    unnamed_.clear();
  }
  return {cubes_, last_link_, file_->end()};
}

BinId DurableStore::add_part(BinId whole) {
  const BinId source = source_of(whole);
  const BinId part = parts_.add_part(kSceneBin);
  std::lock_guard lock(mutex_);
  ++bins_[source]->references;
  sources_.resize(std::max<size_t>(sources_.size(), part + 1));
  sources_[part] = source;
  return kFirstPart + part;
}

BinId DurableStore::source_of(BinId bin) const {
  if (!is_part(bin)) return bin;
  std::lock_guard lock(mutex_);
  return sources_[bin - kFirstPart];
}

void DurableStore::add_chunk(BinId bin, std::span<const std::byte> records) {
  if (is_part(bin)) return parts_.add_chunk(bin - kFirstPart, records);
  const auto triangles = static_cast<uint32_t>(records.size() / record_bytes());
  const Extent extent = file_->append(records);
  std::lock_guard lock(mutex_);
  bins_[bin]->list.add({.extent = extent, .records = triangles});
  unnamed_.push_back({bin, triangles, extent});
  // If the budget has no space for the list, the list is not charged: it is small compared to the
  // triangles.
  charge_.try_resize(list_bytes_ += kChunkListBytes);
}

uint64_t DurableStore::count(BinId bin) const {
  if (is_part(bin)) return parts_.count(bin - kFirstPart);
  std::lock_guard lock(mutex_);
  return bins_[bin]->list.records;
}

std::unique_ptr<TriangleStream> DurableStore::open(BinId bin, uint64_t first) const {
  if (is_part(bin)) return parts_.open(bin - kFirstPart, first);
  std::lock_guard lock(mutex_);
  return open_chunks(bins_[bin]->list, file_.get(), record_bytes(), first);
}

bool DurableStore::drop(BinId bin) {
  if (is_part(bin)) parts_.drop(bin - kFirstPart);
  return true;
}

void DurableStore::retain(BinId bin) {
  if (is_part(bin)) parts_.retain(bin - kFirstPart);
  bin = source_of(bin);
  std::lock_guard lock(mutex_);
  ++bins_[bin]->references;
}

void DurableStore::release(BinId bin) {
  if (is_part(bin)) parts_.release(bin - kFirstPart);
  bin = source_of(bin);
  std::lock_guard lock(mutex_);
  Bin& released = *bins_[bin];
  if (--released.references > 0) return;
  release_chunks(released.list, file_.get());
  list_bytes_ -= released.list.chunks.size() * kChunkListBytes;
  released.list = {};
  charge_.try_resize(list_bytes_);
}

uint64_t DurableStore::file_bytes() const { return parts_.file_bytes() + file_->appended_bytes(); }

}  // namespace voxdag
