#include "scheduler/triangles/chunk.h"

#include <algorithm>
#include <cstring>

namespace voxdag {
namespace {

constexpr size_t kCoordinates = 9;
constexpr size_t kNarrowBytes = kCoordinates * sizeof(int32_t);
constexpr size_t kWideBytes = kCoordinates * sizeof(int64_t);
static_assert(kWideBytes == kMaxTriangleRecordBytes);

template <class Coordinate>
void encode(const FixedTriangle& triangle, std::byte* out) {
  Coordinate record[kCoordinates];
  for (size_t i = 0; i < kCoordinates; ++i)
    record[i] = static_cast<Coordinate>(triangle.v[i / 3][i % 3]);
  std::memcpy(out, record, sizeof record);
}

template <class Coordinate>
void decode(const std::byte* in, FixedTriangle& triangle) {
  Coordinate record[kCoordinates];
  std::memcpy(record, in, sizeof record);
  for (size_t i = 0; i < kCoordinates; ++i) triangle.v[i / 3][i % 3] = record[i];
}

class ChunkStream : public TriangleStream {
 public:
  ChunkStream(const ChunkList& list, const TriangleFile* file, size_t record_bytes, uint64_t first)
      : list_(list), file_(file), record_bytes_(record_bytes), first_(first) {
    rewind();
  }
  uint64_t count() const override { return list_.records - first_; }
  void rewind() override {
    const auto after = std::ranges::upper_bound(list_.chunks, first_, {}, &Chunk::first);
    chunk_ = static_cast<size_t>(after - list_.chunks.begin());
    if (chunk_ > 0) --chunk_;
    record_ = chunk_ < list_.chunks.size() ? first_ - list_.chunks[chunk_].first : 0;
    if (first_ >= list_.records) chunk_ = list_.chunks.size();
    loaded_ = kNoChunk;
  }
  size_t read(std::span<FixedTriangle> out) override {
    size_t filled = 0;
    while (filled < out.size() && chunk_ < list_.chunks.size()) {
      const Chunk& chunk = list_.chunks[chunk_];
      const std::byte* const records = load(chunk);
      const size_t n = std::min<size_t>(out.size() - filled, chunk.records - record_);
      for (size_t i = 0; i < n; ++i, ++record_)
        decode_record(records + record_ * record_bytes_, out[filled + i]);
      filled += n;
      if (record_ == chunk.records) {
        ++chunk_;
        record_ = 0;
      }
    }
    return filled;
  }

 private:
  static constexpr size_t kNoChunk = SIZE_MAX;

  // Returns the records of the current chunk.
  const std::byte* load(const Chunk& chunk) {
    if (!chunk.memory.empty()) return chunk.memory.data();
    if (loaded_ != chunk_) {
      loaded_ = kNoChunk;
      from_file_.resize(chunk.extent.bytes);
      file_->read(chunk.extent, from_file_);
      loaded_ = chunk_;
    }
    return from_file_.data();
  }
  void decode_record(const std::byte* record, FixedTriangle& triangle) const {
    if (record_bytes_ == kNarrowBytes)
      decode<int32_t>(record, triangle);
    else
      decode<int64_t>(record, triangle);
  }

  const ChunkList& list_;
  const TriangleFile* const file_;
  const size_t record_bytes_;
  const uint64_t first_;
  size_t chunk_ = 0;
  size_t record_ = 0;         // next record in the chunk
  size_t loaded_ = kNoChunk;  // the chunk in from_file_
  std::vector<std::byte> from_file_;
};

}  // namespace

void ChunkList::sort_by_offset() {
  std::ranges::sort(chunks, {}, [](const Chunk& chunk) { return chunk.extent.offset; });
  records = 0;
  for (Chunk& chunk : chunks) {
    chunk.first = records;
    records += chunk.records;
  }
}

size_t triangle_record_bytes(bool wide) { return wide ? kWideBytes : kNarrowBytes; }

void encode_triangle(const FixedTriangle& triangle, size_t record_bytes, std::byte* out) {
  if (record_bytes == kNarrowBytes)
    encode<int32_t>(triangle, out);
  else
    encode<int64_t>(triangle, out);
}

std::unique_ptr<TriangleStream> open_chunks(const ChunkList& list, const TriangleFile* file,
                                            size_t record_bytes, uint64_t first) {
  return std::make_unique<ChunkStream>(list, file, record_bytes, first);
}

// Releases adjacent chunks together, because a disk frees only complete blocks.
void release_chunks(const ChunkList& list, TriangleFile* file) {
  Extent piece;
  const auto release = [&] {
    if (piece.bytes) file->release(piece);
  };
  for (const Chunk& chunk : list.chunks) {
    if (!chunk.memory.empty()) continue;
    if (chunk.extent.offset != piece.offset + piece.bytes) {
      release();
      piece = {chunk.extent.offset, 0, 0};
    }
    piece.bytes += chunk.extent.bytes;
  }
  release();
}

}  // namespace voxdag
