#include "scheduler/triangle_bins.h"

#include <algorithm>
#include <cstring>

#include "core/base/error.h"
#include "core/format/checksum.h"

namespace voxdag {
namespace {

constexpr size_t kCoordinates = 9;
constexpr size_t kMostRecordsAChunk = 1024;
constexpr size_t kLeastRecordsAChunk = 16;

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

constexpr size_t kNarrowBytes = kCoordinates * sizeof(int32_t);
constexpr size_t kWideBytes = kCoordinates * sizeof(int64_t);

}  // namespace

TriangleBins::TriangleBins(FileSystem& files, std::string spill_path, bool wide,
                           MemoryBudget& share)
    : files_(files),
      spill_path_(std::move(spill_path)),
      record_bytes_(wide ? kWideBytes : kNarrowBytes),
      charge_(share, 0, "triangle bins") {}

TriangleBins::~TriangleBins() = default;

BinId TriangleBins::add_bin() {
  std::lock_guard lock(mutex_);
  bins_.push_back(std::make_unique<Bin>());
  return static_cast<BinId>(bins_.size() - 1);
}

uint64_t TriangleBins::count(BinId bin) const {
  std::lock_guard lock(mutex_);
  return bins_[bin]->triangles;
}

uint64_t TriangleBins::spilled_bytes() const {
  std::lock_guard lock(mutex_);
  return spilled_bytes_;
}

void TriangleBins::drop(BinId bin) {
  std::lock_guard lock(mutex_);
  for (const Chunk& chunk : bins_[bin]->chunks) memory_bytes_ -= chunk.memory.size() + kListBytes;
  *bins_[bin] = Bin{};
  charge_.try_resize(memory_bytes_);
}

void TriangleBins::add_chunk(BinId bin, std::span<const std::byte> records) {
  Chunk chunk;
  chunk.triangles = static_cast<uint32_t>(records.size() / record_bytes_);
  std::unique_lock lock(mutex_);
  memory_bytes_ += kListBytes;
  if (charge_.try_resize(memory_bytes_ + records.size())) {
    memory_bytes_ += records.size();
    chunk.memory.assign(records.begin(), records.end());
  } else {
    // Where not even the list fits, it goes uncharged: it is little beside what is spilled.
    charge_.try_resize(memory_bytes_);
    if (!spill_writer_) spill_writer_ = files_.create(spill_path_);
    chunk.offset = spilled_bytes_;
    spilled_bytes_ += records.size();
    chunk.checksum = checksum64(records);
    lock.unlock();
    spill_writer_->write_at(chunk.offset, records);
    lock.lock();
    if (!spill_reader_) spill_reader_ = files_.open_read(spill_path_);
  }
  bins_[bin]->triangles += chunk.triangles;
  bins_[bin]->chunks.push_back(std::move(chunk));
}

void TriangleBins::read_chunk(const Chunk& chunk, std::vector<std::byte>& out) const {
  out.resize(chunk.triangles * record_bytes_);
  spill_reader_->read_at(chunk.offset, out);
  if (checksum64(out) != chunk.checksum)
    throw Error(ErrorCode::kCorrupt, spill_path_ + " at offset " + std::to_string(chunk.offset) +
                                         " fails its checksum: the disk gave back other triangles "
                                         "than were written; run the same command again");
}

class BinStream : public TriangleStream {
 public:
  BinStream(const TriangleBins& bins, const TriangleBins::Bin& bin) : bins_(bins), bin_(bin) {}
  uint64_t count() const override { return bin_.triangles; }
  void rewind() override { chunk_ = record_ = 0; }
  size_t read(std::span<FixedTriangle> out) override {
    size_t filled = 0;
    while (filled < out.size() && chunk_ < bin_.chunks.size()) {
      const TriangleBins::Chunk& chunk = bin_.chunks[chunk_];
      if (record_ == 0 && chunk.memory.empty()) bins_.read_chunk(chunk, spilled_);
      const std::byte* records = chunk.memory.empty() ? spilled_.data() : chunk.memory.data();
      const size_t n = std::min<size_t>(out.size() - filled, chunk.triangles - record_);
      for (size_t i = 0; i < n; ++i, ++record_)
        decode_record(records + record_ * bins_.record_bytes_, out[filled + i]);
      filled += n;
      if (record_ == chunk.triangles) {
        ++chunk_;
        record_ = 0;
      }
    }
    return filled;
  }

 private:
  void decode_record(const std::byte* record, FixedTriangle& triangle) const {
    if (bins_.record_bytes_ == kNarrowBytes)
      decode<int32_t>(record, triangle);
    else
      decode<int64_t>(record, triangle);
  }

  const TriangleBins& bins_;
  const TriangleBins::Bin& bin_;
  size_t chunk_ = 0;
  size_t record_ = 0;  // next one of the chunk
  std::vector<std::byte> spilled_;
};

std::unique_ptr<TriangleStream> TriangleBins::open(BinId bin) const {
  std::lock_guard lock(mutex_);
  return std::make_unique<BinStream>(*this, *bins_[bin]);
}

BinWriter::BinWriter(TriangleBins& bins, std::vector<BinId> targets, size_t buffer_bytes)
    : bins_(bins), targets_(std::move(targets)), tails_(targets_.size()) {
  const size_t records =
      buffer_bytes / (bins.record_bytes() * std::max<size_t>(targets_.size(), 1));
  chunk_bytes_ = std::clamp(records, kLeastRecordsAChunk, kMostRecordsAChunk) * bins.record_bytes();
}

void BinWriter::append(size_t target, const FixedTriangle& triangle) {
  std::vector<std::byte>& tail = tails_[target];
  const size_t at = tail.size();
  tail.resize(at + bins_.record_bytes());
  if (bins_.record_bytes() == kNarrowBytes)
    encode<int32_t>(triangle, tail.data() + at);
  else
    encode<int64_t>(triangle, tail.data() + at);
  if (tail.size() < chunk_bytes_) return;
  bins_.add_chunk(targets_[target], tail);
  tail.clear();
}

void BinWriter::finish() {
  for (size_t i = 0; i < tails_.size(); ++i) {
    if (!tails_[i].empty()) bins_.add_chunk(targets_[i], tails_[i]);
    tails_[i] = {};
  }
}

}  // namespace voxdag
