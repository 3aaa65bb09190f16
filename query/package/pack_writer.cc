#include "query/package/pack_writer.h"

#include <cstdio>
#include <limits>
#include <span>

#include "core/base/error.h"
#include "query/package/gzip_block.h"

namespace voxdag::query {
namespace {

constexpr const char* kUnnamedPack = "/packs/unnamed";

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

template <class T>
void append_number(T value, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace

PackWriter::PackWriter(FileSystem& files, const std::string& folder, uint64_t pack_bytes)
    : files_(files), folder_(folder), pack_bytes_(pack_bytes) {
  files_.make_directories(folder_ + "/packs");
}

void PackWriter::begin_band(bool is_color, uint32_t level) {
  index_.bands.push_back({.is_color = is_color, .level = level});
}

void PackWriter::expect_small(std::string_view bytes) const {
  if (bytes.size() > std::numeric_limits<uint16_t>::max())
    throw Error(ErrorCode::kLimit, folder_ + ": a block of the package has " +
                                       std::to_string(bytes.size()) +
                                       " bytes: expected at most 65535");
}

void PackWriter::add_head_block(std::string_view bytes, uint64_t items, uint64_t head_tiles) {
  expect_small(bytes);
  PackageBand& band = index_.bands.back();
  ++band.blocks;
  band.items += items;
  band.head_tiles += head_tiles;
  index_.head.lengths.push_back(static_cast<uint16_t>(bytes.size()));
  head_ += bytes;
  bytes_ += bytes.size();
}

void PackWriter::add_block(std::string_view bytes, uint64_t items, uint64_t code) {
  expect_small(bytes);
  const uint64_t limit =
      index_.packs.empty() ? std::min(kFirstPackBytes, pack_bytes_) : pack_bytes_;
  if (out_ && pack_.bytes + bytes.size() > limit) end_pack();
  if (!out_) out_ = files_.create(folder_ + kUnnamedPack);
  PackageBand& band = index_.bands.back();
  if (lengths_.empty())
    page_ = {.bytes = 0, .pack = index_.packs.size(), .offset = pack_.bytes, .code = code};
  lengths_.push_back(static_cast<uint16_t>(bytes.size()));
  if (band.is_color) codes_.push_back(code);
  out_->write_at(pack_.bytes, bytes_of(bytes));
  checksum_.add(bytes_of(bytes));
  pack_.bytes += bytes.size();
  bytes_ += bytes.size();
  ++pack_.blocks;
  ++band.blocks;
  band.items += items;
  if (lengths_.size() == kPageBlocks) end_page();
}

void PackWriter::end_pack() {
  out_->sync();
  out_->close();
  out_.reset();
  char hash[17];
  std::snprintf(hash, sizeof hash, "%016llx", static_cast<unsigned long long>(checksum_.value()));
  pack_.name = "packs/" + std::to_string(index_.packs.size()) + "-" + hash + ".bin";
  files_.rename(folder_ + kUnnamedPack, folder_ + "/" + pack_.name);
  index_.packs.push_back(pack_);
  pack_ = {};
  checksum_.reset();
}

void PackWriter::end_page() {
  std::string plain;
  for (const uint16_t length : lengths_) append_number(length, plain);
  for (const uint64_t code : codes_) append_number(static_cast<uint32_t>(code), plain);
  for (const uint64_t code : codes_) append_number(static_cast<uint32_t>(code >> 32), plain);
  const std::string bytes = gzip_block(plain);
  page_.bytes = bytes.size();
  index_.pages.push_back(page_);
  directory_ += bytes;
  lengths_.clear();
  codes_.clear();
}

void PackWriter::write_file(const std::string& name, std::string_view contents) {
  const auto out = files_.create(folder_ + "/" + name);
  out->write_at(0, bytes_of(contents));
  out->sync();
  out->close();
}

PackageIndex PackWriter::finish() {
  if (!lengths_.empty()) end_page();
  if (out_) end_pack();
  index_.directory = {hashed_name("directory", directory_, ".bin"), directory_.size(), 0};
  write_file(index_.directory.name, directory_);
  if (!head_.empty()) {
    index_.head.name = hashed_name("head", head_, ".bin");
    index_.head.bytes = head_.size();
    write_file(index_.head.name, head_);
  }
  files_.sync_directory(folder_ + "/packs");
  return std::move(index_);
}

}  // namespace voxdag::query
