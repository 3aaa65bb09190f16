#include "scheduler/triangles/triangle_store.h"

#include <algorithm>
#include <array>

#include "scheduler/triangles/chunk.h"

namespace voxdag {
namespace {

constexpr size_t kMinChunkRecords = 16;

}  // namespace

void add_records(TriangleStore& store, BinId bin, std::span<const std::byte> records) {
  const size_t chunk_bytes = store.max_chunk_records() * store.record_bytes();
  while (!records.empty()) {
    const size_t bytes = std::min(chunk_bytes, records.size());
    store.add_chunk(bin, records.first(bytes));
    records = records.subspan(bytes);
  }
}

BinWriter::BinWriter(TriangleStore& store, std::vector<BinId> targets, size_t buffer_bytes)
    : store_(store),
      targets_(std::move(targets)),
      record_bytes_(store.record_bytes()),
      tails_(targets_.size()) {
  const size_t records = buffer_bytes / (record_bytes_ * std::max<size_t>(targets_.size(), 1));
  chunk_bytes_ = std::clamp(records, kMinChunkRecords, store.max_chunk_records()) * record_bytes_;
}

void BinWriter::append(size_t target, const FixedTriangle& triangle) {
  std::array<std::byte, kMaxTriangleRecordBytes> record;
  encode_triangle(triangle, record_bytes_, record.data());
  append(target, std::span(record).first(record_bytes_));
}

void BinWriter::append(size_t target, std::span<const std::byte> records) {
  std::vector<std::byte>& tail = tails_[target];
  while (!records.empty()) {
    const size_t bytes = std::min(records.size(), chunk_bytes_ - tail.size());
    tail.insert(tail.end(), records.begin(), records.begin() + static_cast<ptrdiff_t>(bytes));
    records = records.subspan(bytes);
    if (tail.size() < chunk_bytes_) return;
    store_.add_chunk(targets_[target], tail);
    tail.clear();
  }
}

void BinWriter::flush() {
  for (size_t i = 0; i < tails_.size(); ++i) {
    if (!tails_[i].empty()) store_.add_chunk(targets_[i], tails_[i]);
    tails_[i].clear();
  }
}

}  // namespace voxdag
