// Writes .npz, which numpy.load() reads: a ZIP archive of arrays in the format .npy 1.0, stored
// without compression. Sizes are always in ZIP64 fields, so that all headers have the same form.
#include <array>
#include <bit>
#include <vector>

#include "core/base/options/option_text.h"
#include "core/format/bytes.h"
#include "core/image/npy_header.h"
#include "query/export/attribute_cursor.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

// Computes the CRC-32 of ZIP files, 8 bytes per step ("slicing by 8").
class Crc32 {
 public:
  Crc32() {
    for (uint32_t i = 0; i < 256; ++i) {
      uint32_t crc = i;
      for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
      tables_[0][i] = crc;
    }
    for (size_t table = 1; table < 8; ++table)
      for (size_t i = 0; i < 256; ++i) {
        const uint32_t crc = tables_[table - 1][i];
        tables_[table][i] = crc >> 8 ^ tables_[0][crc & 255];
      }
  }
  void add(std::span<const std::byte> bytes) {
    size_t at = 0;
    for (; at + 8 <= bytes.size(); at += 8) {
      uint64_t word;
      std::memcpy(&word, bytes.data() + at, 8);
      word ^= crc_;
      crc_ = 0;
      for (size_t i = 0; i < 8; ++i) crc_ ^= tables_[7 - i][word >> 8 * i & 255];
    }
    for (; at < bytes.size(); ++at)
      crc_ = crc_ >> 8 ^ tables_[0][(crc_ ^ static_cast<uint32_t>(bytes[at])) & 255];
  }
  uint32_t value() const { return ~crc_; }

 private:
  std::array<std::array<uint32_t, 256>, 8> tables_;
  uint32_t crc_ = ~0u;
};

struct NpzMember {
  std::string name;
  uint64_t bytes = 0;
  uint64_t offset = 0;  // offset of the member's local header in the file
  uint32_t crc = 0;
};

constexpr uint16_t kZip64Version = 45;

// Writes the fields that are the same in a member's local header and in its central header.
void put_member_fields(ByteSink& sink, const NpzMember& member, uint16_t extra_bytes) {
  sink.put(kZip64Version);  // version needed to read it
  sink.put<uint16_t>(0);    // flags
  sink.put<uint16_t>(0);    // compression method: stored
  sink.put<uint16_t>(0);    // time: midnight
  sink.put<uint16_t>(33);   // date: 1980-01-01
  sink.put(member.crc);
  sink.put(~uint32_t{0});  // both sizes are in the ZIP64 field
  sink.put(~uint32_t{0});
  sink.put(static_cast<uint16_t>(member.name.size()));
  sink.put(extra_bytes);
}

std::vector<std::byte> local_header(const NpzMember& member) {
  std::vector<std::byte> header;
  ByteSink sink(header);
  sink.put<uint32_t>(0x04034b50);
  put_member_fields(sink, member, 20);
  sink.put_bytes(std::as_bytes(std::span(member.name)));
  sink.put<uint16_t>(1);  // ZIP64
  sink.put<uint16_t>(16);
  sink.put(member.bytes);
  sink.put(member.bytes);
  return header;
}

std::vector<std::byte> central_directory(std::span<const NpzMember> members, uint64_t offset) {
  std::vector<std::byte> bytes;
  ByteSink sink(bytes);
  for (const NpzMember& member : members) {
    sink.put<uint32_t>(0x02014b50);
    sink.put(kZip64Version);  // version that created it
    put_member_fields(sink, member, 28);
    sink.put<uint16_t>(0);  // length of the comment
    sink.put<uint16_t>(0);  // number of the disk
    sink.put<uint16_t>(0);  // internal attributes
    sink.put<uint32_t>(0);
    sink.put(~uint32_t{0});  // the offset is in the ZIP64 field
    sink.put_bytes(std::as_bytes(std::span(member.name)));
    sink.put<uint16_t>(1);
    sink.put<uint16_t>(24);
    sink.put(member.bytes);
    sink.put(member.bytes);
    sink.put(member.offset);
  }
  const uint64_t directory_bytes = bytes.size();
  sink.put<uint32_t>(0x06064b50);  // the ZIP64 end record
  sink.put<uint64_t>(44);
  sink.put(kZip64Version);
  sink.put(kZip64Version);
  sink.put<uint32_t>(0);
  sink.put<uint32_t>(0);
  sink.put<uint64_t>(members.size());
  sink.put<uint64_t>(members.size());
  sink.put(directory_bytes);
  sink.put(offset);
  sink.put<uint32_t>(0x07064b50);  // locator of the ZIP64 end record
  sink.put<uint32_t>(0);
  sink.put(offset + directory_bytes);
  sink.put<uint32_t>(1);
  sink.put<uint32_t>(0x06054b50);  // the end record; its fields refer to the ZIP64 record
  sink.put<uint32_t>(0);
  for (int i = 0; i < 2; ++i) sink.put(static_cast<uint16_t>(members.size()));
  sink.put(~uint32_t{0});
  sink.put(~uint32_t{0});
  sink.put<uint16_t>(0);
  return bytes;
}

class NpzWriter {
 public:
  explicit NpzWriter(const ExportJob& job) : job_(job), file_(job.files, job.output) {}

  // Adds an array with `rows` rows of `components` numbers. The numbers have a numpy type such as
  // "<f4". fill(put) must call put(number) for each number.
  template <class Fill>
  void add(const std::string& name, const std::string& type, uint32_t components, uint64_t rows,
           const Fill& fill) {
    const std::string columns = components == 1 ? "" : " " + std::to_string(components);
    const std::string header = npy_header(type, "(" + std::to_string(rows) + "," + columns + ")");
    const uint64_t row_bytes = components * static_cast<uint64_t>(type.back() - '0');
    NpzMember member{name + ".npy", header.size() + rows * row_bytes, file_.size(), 0};
    file_.write(local_header(member));
    Crc32 crc;
    crc.add(std::as_bytes(std::span(header)));
    file_.write(header);
    std::vector<std::byte> block;
    uint64_t written = 0;
    const auto flush = [&] {
      crc.add(block);
      file_.write(std::span<const std::byte>(block));
      written += block.size();
      block.clear();
    };
    fill([&](auto number) {
      const auto bytes = std::as_bytes(std::span(&number, 1));
      block.insert(block.end(), bytes.begin(), bytes.end());
      if (block.size() >= kBlockBytes) flush();
    });
    flush();
    require_written(job_, written / row_bytes, rows);
    member.crc = crc.value();
    // Writes the local header again, because the checksum is known only at this point.
    const uint64_t end = file_.size();
    file_.seek(member.offset);
    file_.write(local_header(member));
    file_.seek(end);
    members_.push_back(member);
  }

  uint64_t finish() {
    file_.write(central_directory(members_, file_.size()));
    ExportFile* const written[] = {&file_};
    return publish(job_, written);
  }

 private:
  static constexpr size_t kBlockBytes = size_t{64} << 10;
  const ExportJob& job_;
  ExportFile file_;
  std::vector<NpzMember> members_;
};

template <class VisitCell>
void visit_cells(const ExportJob& job, ExportStage& stage, const VisitCell& visit) {
  for_each_brick(job.dag, job.selection, [&](const Brick& brick) {
    for_each_cell_of(brick, visit);
    stage.advance(static_cast<uint64_t>(std::popcount(brick.mask)));
  });
}

// A numpy type: its name, such as "float32", and its code in .npy files, such as "<f4".
struct NumpyType {
  const char* name;
  const char* description;
};
NumpyType numpy_type(NumberType number) {
  switch (number) {
    case NumberType::kUint8:
      return {"uint8", "|u1"};
    case NumberType::kUint32:
      return {"uint32", "<u4"};
    case NumberType::kFloat:
      break;
  }
  return {"float32", "<f4"};
}

void add_cells(const ExportJob& job, uint64_t voxels, ExportStage& stage, NpzWriter& writer) {
  writer.add("cells", "<i4", 3, voxels, [&](const auto& put) {
    visit_cells(job, stage, [&](const Position& cell) {
      for (size_t axis = 0; axis < 3; ++axis) put(static_cast<int32_t>(cell[axis]));
    });
  });
}

void add_positions(const ExportJob& job, uint64_t voxels, ExportStage& stage, NpzWriter& writer) {
  writer.add("positions", "<f8", 3, voxels, [&](const auto& put) {
    visit_cells(job, stage, [&](const Position& cell) {
      for (size_t axis = 0; axis < 3; ++axis)
        put(job.world(axis, static_cast<double>(cell[axis]) + 0.5));
    });
  });
}

// Writes the values of one attribute as an array. Returns the array's description for the report.
std::string add_values(const ExportJob& job, uint64_t voxels, AttributeCursor& attribute,
                       ExportStage& stage, NpzWriter& writer) {
  const NumpyType type = numpy_type(attribute.encoding().number);
  writer.add(attribute.traits().plural, type.description, attribute.encoding().components, voxels,
             [&](const auto& put) {
               visit_cells(job, stage, [&](const Position& cell) { attribute.put(cell, put); });
             });
  const std::string info = command_text("info", "json");
  const std::string names =
      ", indexes of the names" + (info.empty() ? "" : " that " + info + " prints");
  return std::string(", '") + attribute.traits().plural + "' (" + type.name +
         (attribute.traits().has_names() ? names : "") + ")";
}

}  // namespace

ExportReport write_npz(const ExportJob& job) {
  ExportReport report;
  // The limit can never be reached: 2^48 voxels have more bytes than file systems support.
  const uint64_t voxels = require_voxels(job, uint64_t{1} << 48, "an array takes");
  report.voxels = voxels;
  std::vector<AttributeCursor> attributes = exported_attributes(job);
  const bool has_positions = !job.options.compact;
  const uint64_t voxel_bytes =
      3 * (sizeof(int32_t) + has_positions * sizeof(double)) + decoded_bytes(attributes);
  require_space(job, voxels * voxel_bytes + 4096);
  NpzWriter writer(job);
  ExportStage stage(job, "export", (1 + has_positions + attributes.size()) * voxels, "rows");
  add_cells(job, voxels, stage, writer);
  if (has_positions) add_positions(job, voxels, stage, writer);
  std::string arrays =
      std::string("numpy.load() gives 'cells' (int32), ") +
      (has_positions ? "'positions' (their centers, float64) and " : "") +
      "'grid' (low corner of the grid and edge of a voxel)" +
      (has_positions ? "" : "; the centers are grid[:3] + (cells + 0.5) * grid[3]");
  for (AttributeCursor& attribute : attributes)
    arrays += add_values(job, voxels, attribute, stage, writer);
  writer.add("grid", "<f8", 1, 4, [&](const auto& put) {
    for (size_t axis = 0; axis < 3; ++axis) put(job.origin(axis));
    put(job.cell_edge());
  });
  report.bytes = writer.finish();
  report.notes.push_back(arrays);
  return report;
}

}  // namespace voxdag::query
