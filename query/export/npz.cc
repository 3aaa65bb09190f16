// .npz: a ZIP archive of arrays in the format .npy 1.0, stored without compression, as
// numpy.load() reads it. Sizes are in ZIP64 fields whatever they are, so that a header has one
// form.
#include <array>
#include <bit>
#include <vector>

#include "core/format/bytes.h"
#include "core/image/npy_header.h"
#include "query/export/color/cell_values.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

// The CRC-32 of ZIP, 8 bytes at a time ("slicing by 8").
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
  uint64_t offset = 0;  // of its local header
  uint32_t crc = 0;
};

constexpr uint16_t kZip64Version = 45;

// The fields that the local and the central header of a member have in common.
void put_member_fields(ByteSink& sink, const NpzMember& member, uint16_t extra_bytes) {
  sink.put(kZip64Version);  // that is needed to read it
  sink.put<uint16_t>(0);    // flags
  sink.put<uint16_t>(0);    // stored
  sink.put<uint16_t>(0);    // midnight
  sink.put<uint16_t>(33);   // 1980-01-01
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
    sink.put(kZip64Version);  // that made it
    put_member_fields(sink, member, 28);
    sink.put<uint16_t>(0);  // comment
    sink.put<uint16_t>(0);  // disk
    sink.put<uint16_t>(0);  // attributes
    sink.put<uint32_t>(0);
    sink.put(~uint32_t{0});  // its offset is in the ZIP64 field
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
  sink.put<uint32_t>(0x07064b50);  // where that is
  sink.put<uint32_t>(0);
  sink.put(offset + directory_bytes);
  sink.put<uint32_t>(1);
  sink.put<uint32_t>(0x06054b50);  // the end record, whose fields point to the above
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

  // Adds an array of `count` numbers; fill(put) calls put(number) for each.
  template <class Number, class Fill>
  void add(const char* name, const std::string& header, uint64_t count, const Fill& fill) {
    NpzMember member{name, header.size() + count * sizeof(Number), file_.size(), 0};
    file_.write(local_header(member));
    Crc32 crc;
    crc.add(std::as_bytes(std::span(header)));
    file_.write(header);
    std::vector<Number> block;
    uint64_t written = 0;
    const auto flush = [&] {
      crc.add(std::as_bytes(std::span(block)));
      file_.write(std::as_bytes(std::span(block)));
      block.clear();
    };
    fill([&](Number number) {
      block.push_back(number);
      ++written;
      if (block.size() == 8192) flush();
    });
    flush();
    // In voxels, of three numbers each.
    require_written(job_, written / 3, count / 3);
    member.crc = crc.value();
    // Only now is the checksum known.
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

}  // namespace

ExportReport write_npz(const ExportJob& job) {
  ExportReport report;
  // No limit of the format is in reach: 2^48 voxels have more bytes than file systems take.
  const uint64_t voxels = require_voxels(job, uint64_t{1} << 48, "an array takes");
  report.voxels = voxels;
  const bool has_colors = job.has_colors;
  const std::vector<Attribute> attributes = exported_values(job);
  uint64_t bytes = 3 * (sizeof(int32_t) + sizeof(double) + (has_colors ? 1 : 0));  // of a voxel
  for (const Attribute attribute : attributes) bytes += exported_bytes(attribute);
  require_space(job, voxels * bytes + 4096);
  NpzWriter writer(job);
  ExportStage stage(job, "export", ((has_colors ? 3 : 2) + attributes.size()) * voxels, "rows");
  const std::string shape = "(" + std::to_string(voxels) + ", 3)";
  writer.add<int32_t>("cells.npy", npy_header("<i4", shape), 3 * voxels, [&](const auto& put) {
    visit_cells(job, stage, [&](const Position& cell) {
      for (size_t axis = 0; axis < 3; ++axis) put(static_cast<int32_t>(cell[axis]));
    });
  });
  writer.add<double>("positions.npy", npy_header("<f8", shape), 3 * voxels, [&](const auto& put) {
    visit_cells(job, stage, [&](const Position& cell) {
      for (size_t axis = 0; axis < 3; ++axis)
        put(job.world(axis, static_cast<double>(cell[axis]) + 0.5));
    });
  });
  if (has_colors)
    writer.add<uint8_t>("colors.npy", npy_header("|u1", shape), 3 * voxels, [&](const auto& put) {
      voxdag_reader::ColorCursor colors(job.file);
      visit_cells(job, stage, [&](const Position& cell) {
        const voxdag_reader::Rgb color = color_of_cell(job, colors, cell);
        for (const uint8_t channel : {color.r, color.g, color.b}) put(channel);
      });
    });
  const std::string column = "(" + std::to_string(voxels) + ",)";
  const auto add_values = [&]<class Number>(Number, const char* name, const std::string& header,
                                            Attribute attribute, uint64_t count) {
    writer.add<Number>(name, header, count, [&](const auto& put) {
      CellValueCursor values(job, attribute);
      visit_cells(job, stage, [&](const std::array<int64_t, 3>& cell) {
        values.put(cell, [&](auto number) { put(static_cast<Number>(number)); });
      });
    });
  };
  for (const Attribute attribute : attributes) {
    if (attribute == Attribute::kAlpha)
      add_values(uint8_t{}, "alphas.npy", npy_header("|u1", column), attribute, voxels);
    else if (attribute == Attribute::kNormal)
      add_values(float{}, "normals.npy", npy_header("<f4", shape), attribute, 3 * voxels);
    else
      add_values(uint32_t{}, "materials.npy", npy_header("<u4", column), attribute, voxels);
  }
  writer.add<double>("grid.npy", npy_header("<f8", "(4,)"), 4, [&](const auto& put) {
    for (size_t axis = 0; axis < 3; ++axis) put(job.file.origin()[axis]);
    put(job.cell_edge());
  });
  report.bytes = writer.finish();
  report.notes.push_back(
      "numpy.load() gives 'cells' (int32), 'positions' (their centers, float64) and 'grid' (low "
      "corner of the grid and edge of a voxel)" +
      std::string(has_colors ? ", and 'colors' (sRGB, uint8)" : ""));
  if (!attributes.empty())
    report.notes.push_back(
        "what the file has of 'alphas' (uint8), 'normals' (float32) and 'materials' (uint32, "
        "numbers in the list that voxdag info --json prints) is there, too");
  return report;
}

}  // namespace voxdag::query
