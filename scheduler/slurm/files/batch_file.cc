#include "scheduler/slurm/files/batch_file.h"

#include <array>
#include <cstring>

#include "core/base/error.h"
#include "core/fields/json_fields.h"
#include "core/fields/json_text.h"
#include "core/format/artifact/artifact_fields.h"
#include "core/format/checksum.h"
#include "scheduler/triangles/chunk.h"

namespace voxdag {

template <class Visitor>
void fields(Visitor& visit, RowExtent& extent) {
  visit("bytes", extent.bytes);
  visit("checksum", extent.checksum);
}

template <class Visitor>
void fields(Visitor& visit, BatchSubvolume& subvolume) {
  visit("id", subvolume.id);
  fields(visit, subvolume.cube);
  visit("weight", subvolume.weight);
  visit("triangles", subvolume.triangles);
  visit(Field("unit").omit_empty(), subvolume.unit);
  visit(Field("views").omit_empty(), subvolume.views);
}

template <class Visitor>
void fields(Visitor& visit, Batch& batch) {
  visit("number", batch.number);
  visit("program", batch.program);
  visit("build", batch.build);
  visit("grid_levels", batch.shape.grid_levels);
  visit("hash_bits", batch.shape.hash_bits);
  visit("rule", batch.rule);
  visit(Field("solid").omit_empty(), batch.solid);
  visit("wide", batch.wide);
  visit("backend", batch.backend);
  visit("method", batch.method);
  visit("longest_edge", batch.longest_edge);
  visit("subvolumes", batch.subvolumes);
}

namespace {

constexpr std::string_view kBatchMagic = "vdbatch3";
constexpr uint64_t kMaxHeaderBytes = uint64_t{256} << 20;

struct Prologue {
  char magic[8];
  uint64_t header_bytes;
  uint64_t header_checksum;
};
static_assert(sizeof(Prologue) == 24);

// Collects bytes and writes them in large blocks.
class BlockWriter {
 public:
  explicit BlockWriter(WritableFile& file) : file_(file) { block_.reserve(kBlockBytes); }
  void add(std::span<const std::byte> bytes) {
    block_.insert(block_.end(), bytes.begin(), bytes.end());
    if (block_.size() >= kBlockBytes) flush();
  }
  void flush() {
    file_.write_at(written_, block_);
    written_ += block_.size();
    block_.clear();
  }

 private:
  static constexpr size_t kBlockBytes = size_t{1} << 20;

  WritableFile& file_;
  std::vector<std::byte> block_;
  uint64_t written_ = 0;
};

template <class T>
std::span<const std::byte> bytes_of(const T& value) {
  return std::as_bytes(std::span(&value, 1));
}

void write_triangles(TriangleStream& triangles, uint64_t expected, size_t record_bytes,
                     const CancelToken& cancel, BlockWriter& out) {
  std::array<FixedTriangle, kBatchChunkRecords> batch;
  std::vector<std::byte> records;
  for (uint64_t left = expected; left > 0;) {
    cancel.check();
    size_t filled = 0;
    const size_t wanted = std::min<uint64_t>(left, batch.size());
    while (filled < wanted) {
      const size_t n = triangles.read(std::span(batch).subspan(filled, wanted - filled));
      if (n == 0)
        throw DamagedTriangles("the stored triangles of a subvolume end after " +
                               std::to_string(expected - left + filled) + " triangles: expected " +
                               std::to_string(expected));
      filled += n;
    }
    records.resize(filled * record_bytes);
    for (size_t i = 0; i < filled; ++i)
      encode_triangle(batch[i], record_bytes, records.data() + i * record_bytes);
    const uint64_t checksum = checksum64(records);
    out.add(bytes_of(checksum));
    out.add(records);
    left -= filled;
  }
}

}  // namespace

double Batch::weight() const {
  double sum = 0;
  for (const BatchSubvolume& subvolume : subvolumes) sum += subvolume.weight;
  return sum;
}

void write_batch(FileSystem& files, const std::string& path, const Batch& batch,
                 const std::function<std::unique_ptr<TriangleStream>(size_t)>& open,
                 const RowFile* rows, const CancelToken& cancel) {
  const std::string header = exact_json_text(record_json(batch));
  const auto header_bytes = std::as_bytes(std::span(header));
  Prologue prologue{{}, header.size(), checksum64(header_bytes)};
  std::memcpy(prologue.magic, kBatchMagic.data(), sizeof prologue.magic);
  const std::string partial = path + ".partial";
  const auto file = files.create(partial);
  BlockWriter out(*file);
  out.add(bytes_of(prologue));
  out.add(header_bytes);
  for (size_t i = 0; i < batch.subvolumes.size(); ++i) {
    const BatchSubvolume& subvolume = batch.subvolumes[i];
    write_triangles(*open(i), subvolume.triangles, triangle_record_bytes(batch.wide), cancel, out);
    for (const RowExtent& views : subvolume.views) out.add(rows->read(views));
  }
  out.flush();
  file->sync();
  file->close();
  files.rename(partial, path);
  files.sync_directory(parent_directory(path));
}

BatchFile::BatchFile(FileSystem& files, const std::string& path) : file_(files.open_own(path)) {
  const auto damaged = [&](const std::string& what) {
    return Error(ErrorCode::kCorrupt, path + ": " + what + ": expected the batch of a build");
  };
  Prologue prologue{};
  if (file_->size() < sizeof prologue)
    throw damaged("it has " + std::to_string(file_->size()) + " bytes");
  file_->read_at(0, std::as_writable_bytes(std::span(&prologue, 1)));
  if (std::string_view(prologue.magic, sizeof prologue.magic) != kBatchMagic)
    throw Error(ErrorCode::kUnsupportedVersion,
                path + ": it does not begin with \"" + std::string(kBatchMagic) +
                    "\": expected a batch file of this version of voxdag; use the same version "
                    "on all machines");
  if (prologue.header_bytes > std::min(kMaxHeaderBytes, file_->size() - sizeof prologue))
    throw damaged("its header has " + std::to_string(prologue.header_bytes) + " bytes, more than " +
                  std::to_string(std::min(kMaxHeaderBytes, file_->size() - sizeof prologue)));
  std::string header(static_cast<size_t>(prologue.header_bytes), '\0');
  const auto header_bytes = std::as_writable_bytes(std::span(header));
  file_->read_at(sizeof prologue, header_bytes);
  if (checksum64(header_bytes) != prologue.header_checksum)
    throw damaged("its header fails its checksum");
  try {
    batch_ = record_from_text<Batch>(header, "its header");
  } catch (const Error& error) {
    throw damaged(error.message());
  }
  data_begin_ = sizeof prologue + header.size();
}

std::vector<BinId> BatchFile::copy_to(TriangleStore& store, SolidRows* rows,
                                      const CancelToken& cancel) const {
  std::vector<Cube> cubes;
  for (const BatchSubvolume& subvolume : batch_.subvolumes) cubes.push_back(subvolume.cube);
  store.add_cube_bins(cubes);
  std::vector<BinId> bins;
  uint64_t offset = data_begin_;
  for (size_t i = 0; i < batch_.subvolumes.size(); ++i) {
    const BatchSubvolume& subvolume = batch_.subvolumes[i];
    bins.push_back(store.cube_bins()[i].bin);
    offset = copy_triangles(offset, subvolume.triangles, store, bins.back(), cancel);
    if (rows != nullptr)
      offset = copy_rows(offset, subvolume, *rows);
    else
      for (const RowExtent& views : subvolume.views) offset += views.bytes;
  }
  return bins;
}

uint64_t BatchFile::copy_triangles(uint64_t offset, uint64_t count, TriangleStore& store, BinId bin,
                                   const CancelToken& cancel) const {
  const size_t record_bytes = triangle_record_bytes(batch_.wide);
  std::vector<std::byte> chunk;
  for (uint64_t left = count; left > 0;) {
    cancel.check();
    const uint64_t n = std::min(left, kBatchChunkRecords);
    chunk.resize(sizeof(uint64_t) + n * record_bytes);
    file_->read_at(offset, chunk);
    const auto records = std::span<const std::byte>(chunk).subspan(sizeof(uint64_t));
    uint64_t checksum = 0;
    std::memcpy(&checksum, chunk.data(), sizeof checksum);
    if (checksum64(records) != checksum)
      throw Error(
          ErrorCode::kCorrupt,
          file_->path() + " at offset " + std::to_string(offset) +
              ": triangles fail their checksum: expected the triangles that were written there");
    add_records(store, bin, records);
    offset += chunk.size();
    left -= n;
  }
  return offset;
}

uint64_t BatchFile::copy_rows(uint64_t offset, const BatchSubvolume& subvolume,
                              SolidRows& rows) const {
  SubvolumeRows added{subvolume.unit, {}};
  if (subvolume.views.size() != std::size(added.views))
    throw Error(ErrorCode::kCorrupt, file_->path() + ": a subvolume has views along " +
                                         std::to_string(subvolume.views.size()) +
                                         " axes: expected 3");
  for (size_t a = 0; a < subvolume.views.size(); ++a) {
    RowExtent extent = subvolume.views[a];
    extent.offset = offset;
    added.views[a] = rows.file().append(read_extent(*file_, extent));
    offset += extent.bytes;
  }
  rows.add(subvolume.cube, added);
  return offset;
}

}  // namespace voxdag
