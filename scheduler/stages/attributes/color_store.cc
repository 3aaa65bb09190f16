#include "scheduler/stages/attributes/color_store.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <exception>
#include <set>

#include "core/base/background.h"
#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/format/bytes.h"

namespace voxdag {
namespace {

constexpr std::string_view kColorMagic = "VDAGCOL\n";
constexpr size_t kHeaderBytes = 56;
constexpr size_t kReadBytes = 256 << 10;
// Flag in `part` of a header: this part is the last part of its artifact.
constexpr uint64_t kLastPart = uint64_t{1} << 63;
// keep_only() does nothing while unused artifacts take at most this many bytes more than used ones.
constexpr uint64_t kTolerableBytes = 64 << 10;

struct Header {
  Checksum128 key;
  uint64_t part = kLastPart;
  uint64_t bytes = 0, checksum = 0;  // size and checksum of the part
};

void append_header(const Header& header, std::vector<std::byte>& out) {
  const size_t at = out.size();
  ByteSink sink(out);
  sink.put_bytes(std::as_bytes(std::span(kColorMagic)));
  for (const uint64_t field :
       {header.key.low, header.key.high, header.part, header.bytes, header.checksum})
    sink.put(field);
  sink.put(checksum64(std::span(out).subspan(at)));
}

// Parses a header. Returns false if `bytes` are not a header.
bool parse_header(std::span<const std::byte> bytes, Header& header) {
  ByteSource in(bytes);
  const bool is_ours =
      std::ranges::equal(in.take(kColorMagic.size()), std::as_bytes(std::span(kColorMagic)));
  for (uint64_t* field :
       {&header.key.low, &header.key.high, &header.part, &header.bytes, &header.checksum})
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
  reader_ = files_.open_own(path_);
  find_artifacts(progress, cancel);
}

void ColorStore::find_artifacts(Progress& progress, const CancelToken& cancel) {
  const uint64_t size = reader_->size();
  std::set<Key> damaged;
  // An artifact's parts are in order in the file, with parts of other artifacts between them.
  Artifacts incomplete;
  std::array<std::byte, kHeaderBytes> bytes;
  for (Header header; size - end_ >= kHeaderBytes;) {
    reader_->read_at(end_, bytes);
    // Bytes after the last complete part belong to an interrupted write.
    if (!parse_header(bytes, header) || header.bytes > size - end_ - kHeaderBytes) break;
    const Key key(header.key.low, header.key.high);
    const Place place{end_ + kHeaderBytes, header.bytes, header.checksum};
    end_ = place.offset + place.bytes;
    const uint64_t number = header.part & ~kLastPart;
    std::vector<Place>& parts = incomplete[key];
    if (number == 0) parts.clear();
    if (!is_sound(place, cancel))
      damaged.insert(key);
    else if (number == parts.size())
      parts.push_back(place);
    if (!(header.part & kLastPart)) continue;
    if (parts.size() == number + 1) found_[key] = std::move(parts);
    incomplete.erase(key);
  }
  std::erase_if(damaged, [&](const Key& key) { return found_.contains(key); });
  if (!damaged.empty())
    progress.warn(path_ + ": damaged colors are baked again; number of cubes: " +
                  std::to_string(damaged.size()));
}

ColorStore::~ColorStore() {
  try {
    if (pending_.valid()) pending_.get();
  } catch (const std::exception&) {
    // Ignores the error. A later run bakes the cubes whose artifacts are not durable.
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

void ColorStore::read(const Place& place, std::vector<std::byte>& out) const {
  std::shared_ptr<ReadableFile> reader;
  {
    const std::lock_guard lock(mutex_);
    reader = reader_;
  }
  out.resize(static_cast<size_t>(place.bytes));
  reader->read_at(place.offset, out);
  if (checksum64(out) != place.checksum)
    throw Error(ErrorCode::kCorrupt, path_ + " at offset " + std::to_string(place.offset) +
                                         " fails its checksum: expected the colors that were "
                                         "written there; " +
                                         repeat_text());
}

ColorStore::Place ColorStore::add(const Checksum128& key, uint64_t number, bool is_last,
                                  std::span<const std::byte> part) {
  const uint64_t checksum = checksum64(part);
  std::vector<std::byte> header;
  append_header({key, number | (is_last ? kLastPart : 0), part.size(), checksum}, header);
  const std::lock_guard lock(mutex_);
  if (!writer_) {
    writer_ = end_ > 0 ? files_.open_write(path_) : files_.create(path_);
    reader_ = files_.open_own(path_);
  }
  const Place place{end_ + kHeaderBytes, part.size(), checksum};
  // The part is written before its header. So if the file has a header, it also has the header's
  // part, unless the power was cut.
  writer_->write_at(place.offset, part);
  writer_->write_at(end_, header);
  end_ = place.offset + place.bytes;
  sync_if_due();
  return place;
}

void ColorStore::keep_only(std::span<const Checksum128> keys, const CancelToken& cancel) {
  Artifacts retained;
  uint64_t retained_bytes = 0;
  for (const Checksum128& key : keys) {
    const auto found = found_.find({key.low, key.high});
    if (found == found_.end() || !retained.insert(*found).second) continue;
    for (const Place& place : found->second) retained_bytes += kHeaderBytes + place.bytes;
  }
  if (end_ <= 2 * retained_bytes + kTolerableBytes) return;
  // If this run is killed, the copy remains until the next copy or the removal of the work folder.
  // The ending of its name marks the copy as a file of voxdag (work_folder.cc).
  const std::string copy_path = path_ + ".vdspill";
  uint64_t end = 0;
  try {
    end = copy(retained, *files_.create(copy_path), cancel);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNoSpace) throw;
    if (files_.exists(copy_path)) files_.remove(copy_path);
    return;
  }
  files_.rename(copy_path, path_);
  files_.sync_directory(parent_directory(path_));
  found_ = std::move(retained);
  reader_ = files_.open_own(path_);
  end_ = end;
}

// Copies `artifacts` to `file` and updates their places. Returns the size of the file.
uint64_t ColorStore::copy(Artifacts& artifacts, WritableFile& file,
                          const CancelToken& cancel) const {
  uint64_t end = 0;
  std::vector<std::byte> part, header;
  for (auto& [key, places] : artifacts)
    for (size_t i = 0; i < places.size(); ++i) {
      cancel.check();
      Place& place = places[i];
      read(place, part);
      const uint64_t last = i + 1 == places.size() ? kLastPart : 0;
      header.clear();
      append_header({{key.first, key.second}, i | last, place.bytes, place.checksum}, header);
      file.write_at(end, header);
      place.offset = end + kHeaderBytes;
      file.write_at(place.offset, part);
      end = place.offset + place.bytes;
    }
  file.sync();
  return end;
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
