#include "scheduler/color/color_store.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <exception>
#include <set>

#include "core/base/background.h"
#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/format/bytes.h"

namespace voxdag {
namespace {

constexpr std::string_view kMagic = "VDAGCOL\n";
constexpr size_t kHeaderBytes = 48;
constexpr size_t kReadBytes = 256 << 10;

struct Header {
  Checksum128 key;
  uint64_t bytes = 0, checksum = 0;  // of the artifact
};

void append_header(const Header& header, std::vector<std::byte>& out) {
  const size_t at = out.size();
  ByteSink sink(out);
  sink.put_bytes(std::as_bytes(std::span(kMagic)));
  for (const uint64_t field : {header.key.low, header.key.high, header.bytes, header.checksum})
    sink.put(field);
  sink.put(checksum64(std::span(out).subspan(at)));
}

// False for what is no header.
bool parse_header(std::span<const std::byte> bytes, Header& header) {
  ByteSource in(bytes);
  const bool is_ours = std::ranges::equal(in.take(kMagic.size()), std::as_bytes(std::span(kMagic)));
  for (uint64_t* field : {&header.key.low, &header.key.high, &header.bytes, &header.checksum})
    *field = in.get<uint64_t>();
  return is_ours && in.get<uint64_t>() == checksum64(bytes.first(kHeaderBytes - sizeof(uint64_t)));
}

}  // namespace

ColorStore::ColorStore(FileSystem& files, std::string path, double sync_interval_s,
                       Progress& progress, const CancelToken& cancel)
    : files_(files),
      path_(std::move(path)),
      sync_interval_s_(sync_interval_s),
      last_sync_s_(wall_seconds()) {
  if (!files_.exists(path_)) return;
  reader_ = files_.open_read(path_);
  const uint64_t size = reader_->size();
  std::set<std::pair<uint64_t, uint64_t>> damaged;  // keys
  std::array<std::byte, kHeaderBytes> bytes;
  for (Header header; size - end_ >= kHeaderBytes;) {
    reader_->read_at(end_, bytes);
    // What follows the last whole artifact was being written when a run was stopped.
    if (!parse_header(bytes, header) || header.bytes > size - end_ - kHeaderBytes) break;
    const Place place{end_ + kHeaderBytes, header.bytes, header.checksum};
    if (is_sound(place, cancel))
      found_[{header.key.low, header.key.high}] = place;
    else
      damaged.insert({header.key.low, header.key.high});
    end_ = place.offset + place.bytes;
  }
  std::erase_if(damaged, [&](const auto& key) { return found_.contains(key); });
  if (!damaged.empty())
    progress.warn(path_ +
                  ": damaged colors are baked again, cubes: " + std::to_string(damaged.size()));
}

ColorStore::~ColorStore() {
  try {
    if (pending_.valid()) pending_.get();
  } catch (const std::exception&) {
    // What is not durable is baked again.
  }
}

bool ColorStore::is_sound(const Place& place, const CancelToken& cancel) const {
  Checksum64 checksum;
  std::vector<std::byte> window(static_cast<size_t>(std::min<uint64_t>(place.bytes, kReadBytes)));
  for (uint64_t at = 0; at < place.bytes; at += window.size()) {
    cancel.check();
    window.resize(static_cast<size_t>(std::min<uint64_t>(window.size(), place.bytes - at)));
    reader_->read_at(place.offset + at, window);
    checksum.add(window);
  }
  return checksum.value() == place.checksum;
}

ColorStore::Place ColorStore::place_of(const Checksum128& key) const {
  const auto found = found_.find({key.low, key.high});
  if (found != found_.end()) return found->second;
  const std::lock_guard lock(mutex_);
  return added_.at({key.low, key.high});
}

void ColorStore::read(const Checksum128& key, std::vector<std::byte>& out) const {
  const Place place = place_of(key);
  out.resize(static_cast<size_t>(place.bytes));
  std::shared_ptr<ReadableFile> reader = reader_;
  if (!has(key)) {
    const std::lock_guard lock(mutex_);
    if (!added_reader_) added_reader_ = files_.open_read(path_);
    reader = added_reader_;
  }
  reader->read_at(place.offset, out);
  if (checksum64(out) != place.checksum)
    throw Error(ErrorCode::kCorrupt, path_ + " at offset " + std::to_string(place.offset) +
                                         " fails its checksum: expected the colors that were read "
                                         "there before; run the same command again");
}

void ColorStore::add(const Checksum128& key, std::span<const std::byte> artifact) {
  std::vector<std::byte> header;
  const uint64_t checksum = checksum64(artifact);
  append_header({key, artifact.size(), checksum}, header);
  const std::lock_guard lock(mutex_);
  if (!writer_) writer_ = end_ > 0 ? files_.open_write(path_) : files_.create(path_);
  // The header last: what it names is there, unless the power is cut.
  writer_->write_at(end_ + kHeaderBytes, artifact);
  writer_->write_at(end_, header);
  added_[{key.low, key.high}] = {end_ + kHeaderBytes, artifact.size(), checksum};
  end_ += kHeaderBytes + artifact.size();
  sync_if_due();
}

void ColorStore::sync_if_due() {
  if (pending_.valid()) {
    if (pending_.wait_for(std::chrono::seconds(0)) == std::future_status::timeout) return;
    pending_.get();
  }
  if (wall_seconds() - last_sync_s_ < sync_interval_s_) return;
  pending_ = run_in_background([this, file = writer_] {
    file->sync();
    if (!name_is_durable_) files_.sync_directory(parent_directory(path_));
    name_is_durable_ = true;
  });
  if (sync_interval_s_ == 0) pending_.get();
  last_sync_s_ = wall_seconds();
}

uint64_t ColorStore::file_bytes() const {
  const std::lock_guard lock(mutex_);
  return end_;
}

}  // namespace voxdag
