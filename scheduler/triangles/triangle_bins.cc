#include "scheduler/triangles/triangle_bins.h"

#include <algorithm>
#include <cstring>

#include "core/base/error.h"

namespace voxdag {
namespace {

constexpr size_t kCoordinates = 9;
constexpr size_t kMaxRecordsPerChunk = 1024;
// Larger ones in a file that is kept: fewer pieces to name, to read and to give back.
constexpr size_t kMaxRecordsPerDurableChunk = 16384;
constexpr size_t kMinRecordsPerChunk = 16;

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
      record_bytes_(record_bytes(wide)),
      charge_(share, 0, "triangle bins") {}

TriangleBins::~TriangleBins() = default;

size_t TriangleBins::record_bytes(bool wide) { return wide ? kWideBytes : kNarrowBytes; }

BinId TriangleBins::add_bin() {
  std::lock_guard lock(mutex_);
  bins_.push_back(std::make_unique<Bin>());
  return static_cast<BinId>(bins_.size() - 1);
}

BinId TriangleBins::add_kept_bin() {
  const BinId bin = add_bin();
  bins_[bin]->kept = true;
  return bin;
}

uint64_t TriangleBins::count(BinId bin) const {
  std::lock_guard lock(mutex_);
  return bins_[bin]->triangles;
}

uint64_t TriangleBins::spilled_bytes() const {
  std::lock_guard lock(mutex_);
  return (spill_ ? spill_->appended_bytes() : 0) + (kept_file_ ? kept_file_->appended_bytes() : 0);
}

void TriangleBins::drop(BinId bin) {
  std::lock_guard lock(mutex_);
  if (!bins_[bin]->kept) give_back(*bins_[bin]);
}

void TriangleBins::hold(BinId bin, uint64_t users) {
  std::lock_guard lock(mutex_);
  bins_[bin]->users += users;
}

void TriangleBins::release(BinId bin) {
  std::lock_guard lock(mutex_);
  if (--bins_[bin]->users == 0) give_back(*bins_[bin]);
}

void TriangleBins::give_back(Bin& bin) {
  // Neighbors go together: only whole blocks of the disk can be given back.
  Extent piece;
  TriangleFile* const file = bin.kept ? kept_file_.get() : spill_.get();
  for (const Chunk& chunk : bin.chunks) {
    memory_bytes_ -= chunk.memory.size() + kListBytes;
    if (!chunk.memory.empty()) continue;
    if (chunk.extent.offset != piece.offset + piece.bytes) {
      if (piece.bytes) file->release(piece);
      piece = {chunk.extent.offset, 0, 0};
    }
    piece.bytes += chunk.extent.bytes;
  }
  if (piece.bytes) file->release(piece);
  bin = Bin{};
  charge_.try_resize(memory_bytes_);
}

void TriangleBins::add_chunk(BinId bin, std::span<const std::byte> records) {
  Chunk chunk;
  chunk.triangles = static_cast<uint32_t>(records.size() / record_bytes_);
  std::unique_lock lock(mutex_);
  Bin& target = *bins_[bin];
  memory_bytes_ += kListBytes;
  if (!target.kept && charge_.try_resize(memory_bytes_ + records.size())) {
    memory_bytes_ += records.size();
    chunk.memory.assign(records.begin(), records.end());
  } else {
    // Where not even the list fits, it goes uncharged: it is little beside what is spilled.
    charge_.try_resize(memory_bytes_);
    if (!target.kept && !spill_) spill_ = std::make_unique<TriangleFile>(files_, spill_path_);
    TriangleFile& file = target.kept ? *kept_file_ : *spill_;
    lock.unlock();
    chunk.extent = file.append(records);
    lock.lock();
    if (target.kept) unchained_.push_back({bin, chunk.triangles, chunk.extent});
  }
  target.triangles += chunk.triangles;
  target.chunks.push_back(std::move(chunk));
}

void TriangleBins::read_chunk(const Bin& bin, const Chunk& chunk,
                              std::vector<std::byte>& out) const {
  out.resize(chunk.extent.bytes);
  (bin.kept ? *kept_file_ : *spill_).read(chunk.extent, out);
}

// A link is the extent of the one before and the chunks that are new since then.
Extent TriangleBins::write_chain() {
  if (unchained_.empty()) return last_link_;
  std::vector<std::byte> link(sizeof last_link_ + unchained_.size() * sizeof(NamedChunk));
  std::memcpy(link.data(), &last_link_, sizeof last_link_);
  std::memcpy(link.data() + sizeof last_link_, unchained_.data(), link.size() - sizeof last_link_);
  last_link_ = kept_file_->append(link);
  unchained_.clear();
  return last_link_;
}

void TriangleBins::read_chain(const Extent& last) {
  std::lock_guard lock(mutex_);
  last_link_ = last;
  for (Extent at = last; at.bytes;) {
    std::vector<std::byte> link(at.bytes);
    kept_file_->read(at, link);
    std::memcpy(&at, link.data(), sizeof at);
    for (size_t i = sizeof at; i < link.size(); i += sizeof(NamedChunk)) {
      NamedChunk chunk;
      std::memcpy(&chunk, link.data() + i, sizeof chunk);
      if (chunk.bin >= bins_.size())
        throw DamagedTriangles("the kept triangles name a bin that is not there");
      bins_[chunk.bin]->chunks.push_back({{}, chunk.extent, chunk.triangles});
      bins_[chunk.bin]->triangles += chunk.triangles;
      memory_bytes_ += kListBytes;
    }
  }
  // Newest links came first; the file is in the order of writing.
  for (const auto& bin : bins_)
    std::ranges::sort(bin->chunks, {}, [](const Chunk& chunk) { return chunk.extent.offset; });
  charge_.try_resize(memory_bytes_);
}

class BinStream : public TriangleStream {
 public:
  BinStream(const TriangleBins& bins, const TriangleBins::Bin& bin, uint64_t first)
      : bins_(bins), bin_(bin), first_(first) {
    rewind();
  }
  uint64_t count() const override { return bin_.triangles - first_; }
  void rewind() override {
    chunk_ = 0;
    uint64_t left = first_;
    while (chunk_ < bin_.chunks.size() && left >= bin_.chunks[chunk_].triangles)
      left -= bin_.chunks[chunk_++].triangles;
    record_ = static_cast<size_t>(left);
    loaded_ = kNoChunk;
  }
  size_t read(std::span<FixedTriangle> out) override {
    size_t filled = 0;
    while (filled < out.size() && chunk_ < bin_.chunks.size()) {
      const TriangleBins::Chunk& chunk = bin_.chunks[chunk_];
      if (chunk.memory.empty() && loaded_ != chunk_) {
        loaded_ = kNoChunk;
        bins_.read_chunk(bin_, chunk, from_file_);
        loaded_ = chunk_;
      }
      const std::byte* records = chunk.memory.empty() ? from_file_.data() : chunk.memory.data();
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
  static constexpr size_t kNoChunk = SIZE_MAX;

  void decode_record(const std::byte* record, FixedTriangle& triangle) const {
    if (bins_.record_bytes_ == kNarrowBytes)
      decode<int32_t>(record, triangle);
    else
      decode<int64_t>(record, triangle);
  }

  const TriangleBins& bins_;
  const TriangleBins::Bin& bin_;
  const uint64_t first_;
  size_t chunk_ = 0;
  size_t record_ = 0;  // next one of the chunk
  size_t loaded_ = kNoChunk;
  std::vector<std::byte> from_file_;
};

std::unique_ptr<TriangleStream> TriangleBins::open(BinId bin, uint64_t first) const {
  std::lock_guard lock(mutex_);
  return std::make_unique<BinStream>(*this, *bins_[bin], first);
}

BinWriter::BinWriter(TriangleBins& bins, std::vector<BinId> targets, size_t buffer_bytes)
    : bins_(bins), targets_(std::move(targets)), tails_(targets_.size()) {
  const size_t records =
      buffer_bytes / (bins.record_bytes() * std::max<size_t>(targets_.size(), 1));
  const size_t most = bins.kept_file() ? kMaxRecordsPerDurableChunk : kMaxRecordsPerChunk;
  chunk_bytes_ = std::clamp(records, kMinRecordsPerChunk, most) * bins.record_bytes();
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

void BinWriter::flush() {
  for (size_t i = 0; i < tails_.size(); ++i) {
    if (!tails_[i].empty()) bins_.add_chunk(targets_[i], tails_[i]);
    tails_[i].clear();
  }
}

}  // namespace voxdag
