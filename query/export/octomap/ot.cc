// Writes OctoMap's octree with occupancies (Hornung et al. 2013): a text header, and then the
// nodes, depth first:
//
//     float     log-odds of the occupancy
//     3 bytes   red, green and blue (sRGB), only in a ColorOcTree
//     1 byte    bit i is 1 if child i exists; 0 in a leaf
//
// Child x + 2y + 4z is at (x, y, z), where each coordinate is 0 or 1. An unknown cube has no node.
// An inner node has the maximum occupancy of its children and the mean color of its colored
// children, as in OctoMap's updateInnerOccupancy(). A file with colors is a ColorOcTree with a leaf
// for each voxel. A file without colors is an OcTree, in which full cubes of 8 cells per edge or
// more are leaves.
#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <optional>
#include <vector>

#include "core/base/text.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/export/faces/growing_buffer.h"
#include "query/export/octomap/octree.h"

namespace voxdag::query {
namespace {

// OctoMap's limits of log-odds, which are the values of cells that are certain: the logarithms of
// 0.971 / 0.029 and of 0.1192 / 0.8808.
constexpr float kOccupiedLogOdds = 3.511F, kFreeLogOdds = -2.0F;
// OctoMap's color of a node without a color.
constexpr voxdag_reader::Rgb kNoColor = {255, 255, 255};

struct OtNode {
  float log_odds = kFreeLogOdds;
  voxdag_reader::Rgb color = kNoColor;
  uint8_t children = 0;
};

// Computes an inner node's values from its children: the largest log-odds, and the mean color of
// the children that have a color.
class OtChildren {
 public:
  void add(int child, const OtNode& node) {
    node_.children = static_cast<uint8_t>(node_.children | 1u << child);
    node_.log_odds = std::max(node_.log_odds, node.log_odds);
    if (node.color == kNoColor) return;
    ++colored_;
    sums_[0] += node.color.r;
    sums_[1] += node.color.g;
    sums_[2] += node.color.b;
  }
  OtNode node() const {
    OtNode node = node_;
    const auto mean = [&](size_t channel) {
      return static_cast<uint8_t>(sums_[channel] / colored_);
    };
    if (colored_ > 0) node.color = {mean(0), mean(1), mean(2)};
    return node;
  }

 private:
  OtNode node_;
  uint32_t colored_ = 0;
  std::array<uint32_t, 3> sums_{};
};

// Makes the nodes depth first. Cubes without voxels are free or unknown, as in bt.cc.
//
// The file has a node before its children, but the node's values depend on its children. So all
// nodes of a cube of kBufferedEdge cells per edge are made in a buffer. The values of larger nodes
// come from a first run, which writes nothing.
class OtTree {
 public:
  using Write = std::function<void(std::span<const std::byte> bytes)>;

  explicit OtTree(const ExportJob& job)
      : job_(job),
        place_(octomap_place(job)),
        region_(job, place_),
        cells_(job, place_),
        colors_(job.file),
        upper_(job.budget, "the upper nodes of the octree") {}

  uint64_t nodes = 0, inner_nodes = 0, voxels = 0;  // found by the first run

  // measure() is the first run, and must precede write(). It passes to `advance` the bytes of all
  // nodes except inner nodes larger than kBufferedEdge.
  void measure(Write advance) {
    write_ = std::move(advance);
    add_upper(kRootCorner, kRootEdge);
  }
  void write(Write write) {
    write_ = std::move(write);
    is_measured_ = true;
    next_upper_ = 0;
    add_upper(kRootCorner, kRootEdge);
  }
  uint64_t node_bytes() const { return sizeof(float) + (job_.has_colors ? 3 : 0) + 1; }

 private:
  static constexpr int64_t kBufferedEdge = 64;
  static constexpr int64_t kRootEdge = int64_t{1} << kOctoMapLevels;
  static constexpr Position kRootCorner = {-kHalfTree, -kHalfTree, -kHalfTree};

  // These functions add the nodes of a cube, and return the cube's node; nullopt if the cube is
  // unknown.
  std::optional<OtNode> add_upper(const Position& corner, int64_t edge) {
    if (edge == kBufferedEdge) {
      const std::optional<OtNode> node = add_buffered(corner, edge, 0);
      write_buffer();
      return node;
    }
    if (!region_.has_voxels(corner, edge)) {
      if (region_.contains(corner, edge)) return add_leaf(OtNode{}, true);
      if (!region_.has_known_part(corner, edge)) return std::nullopt;
    }
    const size_t index = next_upper_++;
    if (is_measured_) {
      append(upper_[index]);
      write_buffer();
    } else {
      upper_.push_back({});
      count_inner();
    }
    OtChildren children;
    for (int child = 0; child < 8; ++child) {
      const Position at = OctreeRegion::child_corner(corner, child, edge / 2);
      if (const auto node = add_upper(at, edge / 2)) children.add(child, *node);
    }
    if (!is_measured_) upper_[index] = children.node();
    return children.node();
  }

  // `index` is the index of the cube's first cell in the current block.
  std::optional<OtNode> add_buffered(const Position& corner, int64_t edge, uint64_t index) {
    const Content content = content_of(corner, edge, index);
    const bool is_leaf = edge == 1 || (edge > kBrickEdge && !job_.has_colors);
    if (content == Content::kFull && is_leaf) return add_leaf(occupied(corner), false);
    if (content == Content::kNothing) {
      if (region_.contains(corner, edge)) return add_leaf(OtNode{}, false);
      if (!region_.has_known_part(corner, edge)) return std::nullopt;
    }
    const size_t begin = buffer_.size();
    append({});
    if (!is_measured_) count_inner();
    OtChildren children;
    for (int child = 0; child < 8; ++child) {
      const Position at = OctreeRegion::child_corner(corner, child, edge / 2);
      const uint64_t first =
          edge <= kBlockEdge ? index + static_cast<uint64_t>(child) * cells_of_cube(edge / 2) : 0;
      if (const auto node = add_buffered(at, edge / 2, first)) children.add(child, *node);
    }
    put(begin, children.node());
    return children.node();
  }
  Content content_of(const Position& corner, int64_t edge, uint64_t index) {
    if (edge > kBlockEdge)
      return region_.has_voxels(corner, edge) ? Content::kSomething : Content::kNothing;
    if (edge == kBlockEdge) {
      const uint64_t count = cells_.read(corner, region_.part_of(corner, edge));
      if (!is_measured_) voxels += count;
    }
    return cells_.content(index, edge);
  }

  OtNode occupied(const Position& corner) {
    OtNode node{.log_odds = kOccupiedLogOdds};
    if (!job_.has_colors) return node;
    Position cell = corner;
    for (size_t axis = 0; axis < 3; ++axis) cell[axis] -= place_[axis];
    node.color = color_of_cell(job_, colors_, cell);
    return node;
  }
  OtNode add_leaf(const OtNode& node, bool is_upper) {
    append(node);
    if (is_upper) write_buffer();
    if (!is_measured_) ++nodes;
    return node;
  }
  void count_inner() {
    ++nodes;
    ++inner_nodes;
  }

  void append(const OtNode& node) {
    buffer_.resize(buffer_.size() + node_bytes());
    put(buffer_.size() - node_bytes(), node);
  }
  void put(size_t at, const OtNode& node) {
    std::memcpy(&buffer_[at], &node.log_odds, sizeof(float));
    at += sizeof(float);
    if (job_.has_colors)
      for (const uint8_t channel : {node.color.r, node.color.g, node.color.b})
        buffer_[at++] = std::byte{channel};
    buffer_[at] = std::byte{node.children};
  }
  void write_buffer() {
    write_(buffer_);
    buffer_.clear();
  }

  const ExportJob& job_;
  const Position place_;
  const OctreeRegion region_;
  BlockCells cells_;
  voxdag_reader::ColorCursor colors_;
  GrowingBuffer<OtNode> upper_;  // nodes larger than kBufferedEdge, in the order of the file
  size_t next_upper_ = 0;
  bool is_measured_ = false;
  Write write_;
  std::vector<std::byte> buffer_;
};

std::string ot_header(const ExportJob& job, uint64_t nodes) {
  return std::string("# Octomap OcTree file\n# written by voxdag\nid ") +
         (job.has_colors ? "ColorOcTree" : "OcTree") + "\nsize " + std::to_string(nodes) +
         "\nres " + number_text(job.cell_edge()) + "\ndata\n";
}

}  // namespace

ExportReport write_ot(const ExportJob& job) {
  check_octomap_levels(job);
  OtTree tree(job);
  {
    ExportStage stage(job, "count", 0, "nodes");
    tree.measure(
        [&](std::span<const std::byte> bytes) { stage.advance(bytes.size() / tree.node_bytes()); });
  }
  if (tree.voxels == 0) refuse_empty(job);
  const std::string header = ot_header(job, tree.nodes);
  require_space(job, header.size() + tree.node_bytes() * tree.nodes);
  ExportReport report;
  report.voxels = tree.voxels;
  ExportFile file(job.files, job.output);
  file.write(header);
  {
    ExportStage stage(job, "export", tree.nodes, "nodes");
    tree.write([&](std::span<const std::byte> bytes) {
      file.write(bytes);
      stage.advance(bytes.size() / tree.node_bytes());
    });
  }
  ExportFile* const written[] = {&file};
  report.bytes = publish(job, written);
  report_octomap(job, tree.nodes, tree.inner_nodes, report);
  return report;
}

}  // namespace voxdag::query
