#include "core/format/artifact/artifact_writer.h"

#include <algorithm>
#include <string>

#include "core/base/error.h"
#include "core/base/popcount8.h"
#include "core/dag/node_hash.h"
#include "core/format/artifact/artifact_index.h"
#include "core/format/artifact/frame_codec.h"
#include "core/format/artifact/row_order.h"
#include "core/format/checksum.h"

namespace voxdag {

struct ArtifactWriter::State {
  SegmentWriter& segment;
  uint64_t offset;
  ArtifactIndex index;
  bool level_open = false;
  uint64_t child_rows = 0;  // rows of the level below the open level
  LastRow last;
  // Rows that do not yet fill a frame.
  std::vector<uint64_t> values;  // hashes of nodes, or masks of bricks
  std::vector<uint8_t> masks;
  std::vector<uint32_t> children;

  State(SegmentWriter& s, const DagShape& shape)
      : segment(s), offset(s.size()), index{shape, {}, {}} {
    values.reserve(kFrameRows);
    masks.reserve(kFrameRows);
    children.reserve(8 * kFrameRows);
  }

  [[noreturn]] void fail(ErrorCode code, const std::string& what) const {
    const std::string level =
        index.levels.empty() ? "" : ", level " + std::to_string(index.levels.back().level);
    throw Error(code, "artifact for segment " + std::to_string(segment.id()) + level + ": " + what);
  }
  [[noreturn]] void broken(const std::string& what) const { fail(ErrorCode::kCorrupt, what); }

  void add_frame(std::span<const std::byte> bytes, uint64_t first_hash, size_t rows,
                 size_t child_count) {
    ArtifactLevel& level = index.levels.back();
    FrameInfo frame;
    frame.first_row = level.rows;
    frame.first_child = level.children;
    frame.first_hash = first_hash;
    frame.offset = segment.size();
    frame.bytes = static_cast<uint32_t>(bytes.size());
    frame.rows = static_cast<uint32_t>(rows);
    frame.children = static_cast<uint32_t>(child_count);
    frame.checksum = checksum64(bytes);
    segment.append(bytes);
    level.frames.push_back(frame);
    level.rows += rows;
    level.children += child_count;
    if (level.rows > uint64_t{1} << 32)
      fail(ErrorCode::kLimit,
           "it has " + std::to_string(level.rows) + " nodes, expected at most 2^32");
  }

  void add_brick_frame(std::span<const uint64_t> rows);
  void add_node_frame(const NodeLevelView& rows);
  void add_pending_frame();
};

void ArtifactWriter::State::add_brick_frame(std::span<const uint64_t> rows) {
  uint64_t hashes[kFrameRows];
  for (size_t i = 0; i < rows.size(); ++i)
    hashes[i] = truncate_hash(hash_brick(rows[i]), index.shape.hash_bits);
  if (const char* wrong = check_brick_order(std::span(hashes, rows.size()), rows, last))
    broken(wrong);
  add_frame(segment.encoder_->encode_bricks(rows), hashes[0], rows.size(), 0);
}

void ArtifactWriter::State::add_node_frame(const NodeLevelView& rows) {
  if (const char* wrong = check_node_order(rows, child_rows, index.shape.hash_bits, last))
    broken(wrong);
  add_frame(segment.encoder_->encode_nodes(rows), rows.hashes[0], rows.masks.size(),
            rows.children.size());
}

void ArtifactWriter::State::add_pending_frame() {
  if (values.empty()) return;
  if (index.levels.size() == 1)
    add_brick_frame(values);
  else
    add_node_frame({index.levels.back().level, values, masks, children});
  values.clear();
  masks.clear();
  children.clear();
}

ArtifactWriter::ArtifactWriter(SegmentWriter& segment, const DagShape& shape)
    : state_(std::make_unique<State>(segment, shape)) {}

ArtifactWriter::~ArtifactWriter() = default;

void ArtifactWriter::begin_level(uint32_t level) {
  State& s = *state_;
  if (s.level_open || level + s.index.levels.size() != s.index.shape.brick_level())
    s.broken("level " + std::to_string(level) + " does not follow the level before it" +
             (s.level_open ? ", which is still open" : ""));
  s.child_rows = s.index.levels.empty() ? 0 : s.index.levels.back().rows;
  s.last = {};
  s.index.levels.push_back({level, 0, 0, {}});
  s.level_open = true;
}

void ArtifactWriter::append_bricks(std::span<const uint64_t> masks) {
  State& s = *state_;
  if (!s.level_open || s.index.levels.size() != 1)
    s.broken("bricks were added at a wrong time: expected them only while the brick level is open");
  while (!masks.empty()) {
    const size_t n = std::min<size_t>(masks.size(), kFrameRows - s.values.size());
    if (n == kFrameRows)
      s.add_brick_frame(masks.first(n));
    else
      s.values.insert(s.values.end(), masks.begin(), masks.begin() + n);
    if (s.values.size() == kFrameRows) s.add_pending_frame();
    masks = masks.subspan(n);
  }
}

void ArtifactWriter::append_nodes(const NodeLevelView& rows) {
  State& s = *state_;
  if (!s.level_open || s.index.levels.size() < 2)
    s.broken(
        "nodes were added at a wrong time: expected them only while a level above the bricks is "
        "open");
  if (rows.masks.size() != rows.hashes.size())
    s.broken(std::to_string(rows.masks.size()) + " masks, expected " +
             std::to_string(rows.hashes.size()) + ", the number of hashes");
  size_t at = 0, at_child = 0;
  while (at < rows.masks.size()) {
    const size_t n = std::min<size_t>(rows.masks.size() - at, kFrameRows - s.values.size());
    size_t child_count = 0;
    for (const uint8_t mask : rows.masks.subspan(at, n)) child_count += kPopcount8[mask];
    if (child_count > rows.children.size() - at_child)
      s.broken("children are missing: expected " + std::to_string(child_count) + " for " +
               std::to_string(n) + " nodes, found " +
               std::to_string(rows.children.size() - at_child));
    const NodeLevelView part{rows.level, rows.hashes.subspan(at, n), rows.masks.subspan(at, n),
                             rows.children.subspan(at_child, child_count)};
    if (n == kFrameRows) {
      s.add_node_frame(part);
    } else {
      s.values.insert(s.values.end(), part.hashes.begin(), part.hashes.end());
      s.masks.insert(s.masks.end(), part.masks.begin(), part.masks.end());
      s.children.insert(s.children.end(), part.children.begin(), part.children.end());
    }
    if (s.values.size() == kFrameRows) s.add_pending_frame();
    at += n;
    at_child += child_count;
  }
  if (at_child != rows.children.size())
    s.broken("children are left over: found " + std::to_string(rows.children.size()) +
             ", expected " + std::to_string(at_child));
}

void ArtifactWriter::end_level() {
  State& s = *state_;
  if (!s.level_open) s.broken("no level is open: expected an open level to end");
  s.add_pending_frame();
  if (s.index.levels.back().rows == 0) s.broken("the level has no nodes: expected at least one");
  s.level_open = false;
}

void ArtifactWriter::bricks(const BrickLevelView& level) {
  begin_level(state_->index.shape.brick_level());
  append_bricks(level.masks);
  end_level();
}

void ArtifactWriter::nodes(const NodeLevelView& level) {
  begin_level(level.level);
  append_nodes(level);
  end_level();
}

ArtifactRef ArtifactWriter::finish(std::span<const ArtifactRoot> roots) {
  State& s = *state_;
  if (s.level_open) s.broken("the level is still open: expected the end of all levels");
  s.index.roots.assign(roots.begin(), roots.end());
  const std::string where = "artifact for segment " + std::to_string(s.segment.id());
  return s.segment.append_index(s.offset, encode_index(s.index, where));
}

}  // namespace voxdag
