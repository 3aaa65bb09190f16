#include "scheduler/triangles/triangle_store.h"

#include <algorithm>
#include <array>
#include <utility>

#include "scheduler/triangles/chunk.h"

namespace voxdag {
namespace {

constexpr size_t kMinChunkRecords = 16;

size_t chunk_bytes(const TriangleStore& store, size_t targets, size_t buffer_bytes) {
  const size_t records = buffer_bytes / (store.record_bytes() * std::max<size_t>(targets, 1));
  return std::clamp(records, kMinChunkRecords, store.max_chunk_records()) * store.record_bytes();
}

}  // namespace

void add_records(TriangleStore& store, BinId bin, std::span<const std::byte> records) {
  const size_t max_bytes = store.max_chunk_records() * store.record_bytes();
  while (!records.empty()) {
    const size_t bytes = std::min(max_bytes, records.size());
    store.add_chunk(bin, records.first(bytes));
    records = records.subspan(bytes);
  }
}

BinWriter::BinWriter(TriangleStore& store, std::vector<BinId> targets, size_t buffer_bytes)
    : record_bytes_(store.record_bytes()),
      writer_(targets.size(), chunk_bytes(store, targets.size(), buffer_bytes),
              [&store, targets](size_t target, std::span<const std::byte> records, uint32_t) {
                store.add_chunk(targets[target], records);
              }) {}

void BinWriter::append(size_t target, const FixedTriangle& triangle) {
  std::array<std::byte, kMaxTriangleRecordBytes> record;
  encode_triangle(triangle, record_bytes_, record.data());
  writer_.append(target, std::span(record).first(record_bytes_), 1);
}

void BinWriter::append(size_t target, std::span<const std::byte> records) {
  while (!records.empty()) {
    const size_t bytes = std::min(records.size(), writer_.missing_bytes(target));
    writer_.append(target, records.first(bytes), static_cast<uint32_t>(bytes / record_bytes_));
    records = records.subspan(bytes);
  }
}

}  // namespace voxdag
