#include "scheduler/solid/solid_rows.h"

#include <utility>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/format/checksum.h"
#include "core/format/cube_bytes.h"
#include "scheduler/solid/row_sums.h"

namespace voxdag {
namespace {

constexpr uint64_t kMagic = 0x31776f7267647876ull;
constexpr uint64_t kRowsHeaderBytes = 64;

void put(ByteSink& sink, const RowExtent& extent) {
  for (const uint64_t word : {extent.offset, extent.bytes, extent.checksum}) sink.put(word);
}
RowExtent get_extent(ByteSource& source) {
  RowExtent extent;
  for (uint64_t* word : {&extent.offset, &extent.bytes, &extent.checksum})
    *word = source.get<uint64_t>();
  return extent;
}

std::vector<std::byte> header_of(const RowExtent& index) {
  std::vector<std::byte> header;
  ByteSink sink(header);
  sink.put(kMagic);
  put(sink, index);
  sink.put(checksum64(header));
  header.resize(kRowsHeaderBytes);
  return header;
}

}  // namespace

SolidRows::SolidRows(FileSystem& files, std::string path, SolidRule rule, uint32_t grid_levels,
                     std::string identity)
    : files_(files),
      path_(std::move(path)),
      rule_(rule),
      grid_levels_(grid_levels),
      identity_(std::move(identity)) {}

SolidRows::~SolidRows() = default;

bool SolidRows::load() {
  if (!files_.exists(path_)) return false;
  try {
    const auto file = files_.open_read(path_);
    if (file->size() < kRowsHeaderBytes) return false;
    std::vector<std::byte> header(kRowsHeaderBytes);
    file->read_at(0, header);
    ByteSource source(header);
    source.get<uint64_t>();
    const RowExtent index = get_extent(source);
    if (header != header_of(index) || index.offset + index.bytes > file->size()) return false;
    if (!decode_index(read_extent(*file, index))) return false;
    file_ = std::make_unique<RowFile>(files_, path_, file->size());
    return true;
  } catch (const Error& error) {
    if (!error.is_corruption()) throw;
    return false;
  }
}

void SolidRows::start() {
  cubes_.clear();
  full_cubes.clear();
  counts = {};
  files_.create(path_)->write_at(0, std::vector<std::byte>(kRowsHeaderBytes));
  file_ = std::make_unique<RowFile>(files_, path_, kRowsHeaderBytes);
}

void SolidRows::save() {
  const std::lock_guard lock(mutex_);
  const RowExtent index = file_->append(encode_index());
  file_->file().sync();
  file_->file().write_at(0, header_of(index));
  file_->file().sync();
  files_.sync_directory(parent_directory(path_));
}

void SolidRows::add(const Cube& cube, const SubvolumeRows& rows) {
  const std::lock_guard lock(mutex_);
  cubes_[cube] = rows;
}

SubvolumeRows SolidRows::find(const Cube& cube) const {
  const std::lock_guard lock(mutex_);
  const auto found = cubes_.find(cube);
  if (found == cubes_.end())
    throw Error(ErrorCode::kCorrupt, path_ + ": it lacks the rows of a subvolume of level " +
                                         std::to_string(cube.level) + ": start over with " +
                                         option_text("restart"));
  return found->second;
}

SolidEntry SolidRows::read_entry(const Cube& cube) const {
  const SubvolumeRows rows = find(cube);
  SolidEntry entry{rule_, {}};
  for (int a = 0; a < 3; ++a) {
    entry.views[a].resize(rows_per_axis(cube, grid_levels_));
    file_->read_rows(rows.views[a], entry.views[a]);
  }
  return entry;
}

std::vector<std::byte> SolidRows::encode_index() const {
  std::vector<std::byte> bytes;
  ByteSink sink(bytes);
  sink.put(static_cast<uint64_t>(identity_.size()));
  sink.put_bytes(std::as_bytes(std::span(identity_)));
  for (const uint64_t count : {counts.rows, counts.open, counts.odd}) sink.put(count);
  sink.put(static_cast<uint64_t>(cubes_.size()));
  for (const auto& [cube, rows] : cubes_) {
    put_cube(sink, cube);
    sink.put(static_cast<uint32_t>(rows.unit));
    for (const RowExtent& views : rows.views) put(sink, views);
  }
  sink.put(static_cast<uint64_t>(full_cubes.size()));
  for (const FullCube& full : full_cubes) {
    put_cube(sink, full.cube);
    sink.put(static_cast<uint32_t>(full.is_disputed));
  }
  return bytes;
}

bool SolidRows::decode_index(std::span<const std::byte> bytes) {
  ByteSource source(bytes);
  const auto identity = source.take(source.get<uint64_t>());
  if (std::string(reinterpret_cast<const char*>(identity.data()), identity.size()) != identity_)
    return false;
  for (uint64_t* count : {&counts.rows, &counts.open, &counts.odd}) *count = source.get<uint64_t>();
  cubes_.clear();
  for (uint64_t n = source.get<uint64_t>(); n > 0 && source.ok(); --n) {
    const Cube cube = get_cube(source);
    SubvolumeRows& rows = cubes_[cube];
    rows.unit = static_cast<SolidUnit>(source.get<uint32_t>());
    for (RowExtent& views : rows.views) views = get_extent(source);
  }
  full_cubes.clear();
  for (uint64_t n = source.get<uint64_t>(); n > 0 && source.ok(); --n) {
    const Cube cube = get_cube(source);
    full_cubes.push_back({cube, source.get<uint32_t>() != 0});
  }
  return source.ok();
}

}  // namespace voxdag
