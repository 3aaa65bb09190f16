// Writes OctoMap's binary octree (Hornung et al. 2013): a text header, and then two bytes for each
// inner node, depth first. Bits 2i and 2i + 1 of the two bytes are the state of child i, as a
// number: 0 unknown, 1 free, 2 occupied, 3 an inner node. Child x + 2y + 4z is at (x, y, z), where
// each coordinate is 0 or 1. This code does not use the OctoMap library, because the library would
// store all nodes in memory.
#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "core/base/text.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/export/octomap/octree.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kNodeBytes = 2;
enum BtChild : uint32_t { kUnknown = 0, kFree = 1, kOccupied = 2, kInner = 3 };

// Makes the nodes depth first. A full cube of 8 to 256 cells per edge becomes one occupied leaf.
// Cubes without voxels become free if they are in the selected region, even inside closed objects:
// a surface does not show which of its sides is solid (docs/export.md). Outside the region, cubes
// are unknown.
//
// The bits of a node are known only after the nodes below it were made, but the file has the node
// first. So all nodes of a cube of kBufferedEdge cells per edge are made in a buffer (at most 40
// MiB), and the bits of each node are set after its children. Larger cubes do not fit in the
// buffer. For these, a search for a voxel decides whether they are inner nodes.
class BtTree {
 public:
  // A function that receives the bytes of the next nodes of the file.
  using Write = std::function<void(std::span<const uint8_t> bytes)>;

  BtTree(const ExportJob& job, Write write)
      : write_(std::move(write)),
        region_(job, octomap_place(job)),
        cells_(job, octomap_place(job)) {}
  uint64_t nodes = 1, inner_nodes = 0, voxels = 0;  // `nodes` includes the root

  void run() { write_upper({-kHalfTree, -kHalfTree, -kHalfTree}, int64_t{1} << kOctoMapLevels); }

 private:
  static constexpr int64_t kBufferedEdge = 512;
  // The states of the children of one node: the two bytes of the node, and whether all children are
  // full.
  struct Children {
    uint32_t bits = 0;
    bool all_full = true;
  };

  void write_upper(const Position& corner, int64_t edge) {
    if (edge == kBufferedEdge) {
      add_nodes(corner, edge, true);
      write_(buffer_);
      return buffer_.clear();
    }
    Children children;
    for (int child = 0; child < 8; ++child) {
      const Position at = OctreeRegion::child_corner(corner, child, edge / 2);
      add(child, region_.has_voxels(at, edge / 2) ? Content::kSomething : Content::kNothing, at,
          edge / 2, children);
    }
    ++inner_nodes;
    const std::array<uint8_t, 2> bits = bytes_of(children);
    write_(bits);
    for (int child = 0; child < 8; ++child)
      if ((children.bits >> 2 * child & 3) == kInner)
        write_upper(OctreeRegion::child_corner(corner, child, edge / 2), edge / 2);
  }

  // Adds the nodes of a cube to the buffer, and returns its content. Adds no nodes for a full cube,
  // and none for a cube without voxels unless has_known_part() is true: the state of such a cube is
  // in the node of its parent. With `is_top`, always adds at least one node.
  Content add_nodes(const Position& corner, int64_t edge, bool is_top) {
    if (!is_top && edge == kBlockEdge) return add_block(corner);
    if (!is_top && !region_.has_voxels(corner, edge) && !region_.has_known_part(corner, edge))
      return Content::kNothing;
    const size_t begin = buffer_.size();
    const uint64_t nodes_before = nodes;
    buffer_.insert(buffer_.end(), {0, 0});
    Children children;
    for (int child = 0; child < 8; ++child) {
      const Position at = OctreeRegion::child_corner(corner, child, edge / 2);
      add(child, add_nodes(at, edge / 2, false), at, edge / 2, children);
    }
    if (children.all_full && !is_top) {  // the cube becomes a leaf of its parent
      buffer_.resize(begin);
      nodes = nodes_before;
      return Content::kFull;
    }
    ++inner_nodes;
    std::ranges::copy(bytes_of(children), buffer_.begin() + static_cast<ptrdiff_t>(begin));
    return Content::kSomething;
  }

  Content add_block(const Position& corner) {
    const uint64_t count = cells_.read(corner, region_.part_of(corner, kBlockEdge));
    voxels += count;
    if (count == 0 && !region_.has_known_part(corner, kBlockEdge)) return Content::kNothing;
    if (count == cells_of_cube(kBlockEdge)) return Content::kFull;
    add_block_nodes(corner, 0, kBlockEdge);
    return Content::kSomething;
  }
  // Adds the nodes of a cube in the current block. `index` is the index in `cells_` of the first
  // cell of the cube.
  void add_block_nodes(const Position& corner, uint64_t index, int64_t edge) {
    const size_t begin = buffer_.size();
    buffer_.insert(buffer_.end(), {0, 0});
    ++inner_nodes;
    Children children;
    const int64_t half = edge / 2;
    for (int child = 0; child < 8; ++child) {
      const Position at = OctreeRegion::child_corner(corner, child, half);
      const uint64_t first = index + static_cast<uint64_t>(child) * cells_of_cube(half);
      if (add(child, cells_.content(first, half), at, half, children))
        add_block_nodes(at, first, half);
    }
    std::ranges::copy(bytes_of(children), buffer_.begin() + static_cast<ptrdiff_t>(begin));
  }

  // Adds the state of a child cube, with this low corner and edge, to `children`. Returns true if
  // the child is an inner node.
  bool add(int child, Content content, const Position& corner, int64_t edge, Children& children) {
    uint32_t state = region_.contains(corner, edge) ? kFree : kUnknown;
    if (content == Content::kFull && (edge == 1 || edge > kBrickEdge))
      state = kOccupied;
    else if (content != Content::kNothing || region_.has_known_part(corner, edge))
      state = kInner;
    nodes += state != kUnknown;
    children.bits |= state << 2 * child;
    children.all_full = children.all_full && content == Content::kFull;
    return state == kInner;
  }
  static std::array<uint8_t, 2> bytes_of(const Children& children) {
    return {static_cast<uint8_t>(children.bits), static_cast<uint8_t>(children.bits >> 8)};
  }

  const Write write_;
  const OctreeRegion region_;
  BlockCells cells_;
  std::vector<uint8_t> buffer_;
};

std::string bt_header(uint64_t nodes, double cell_edge) {
  return "# Octomap OcTree binary file\n# written by voxdag\nid OcTree\nsize " +
         std::to_string(nodes) + "\nres " + number_text(cell_edge) + "\ndata\n";
}

}  // namespace

ExportReport write_bt(const ExportJob& job) {
  check_octomap_levels(job);
  std::optional<ExportStage> counting(std::in_place, job, "count", 0, "nodes");
  BtTree counted(job, [&](std::span<const uint8_t> bytes) {
    counting->advance(bytes.size() / kNodeBytes);
    counting->report();
  });
  counted.run();
  counting.reset();
  if (counted.voxels == 0) refuse_empty(job);
  const std::string header = bt_header(counted.nodes, job.cell_edge());
  require_space(job, header.size() + kNodeBytes * counted.inner_nodes);
  ExportReport report;
  report.voxels = counted.voxels;
  ExportFile file(job.files, job.output);
  file.write(header);
  {
    ExportStage stage(job, "export", counted.inner_nodes, "nodes");
    BtTree(job, [&](std::span<const uint8_t> bytes) {
      file.write(std::as_bytes(bytes));
      stage.advance(bytes.size() / kNodeBytes);
      stage.report();
    }).run();
  }
  ExportFile* const written[] = {&file};
  report.bytes = publish(job, written);
  report_octomap(job, counted.nodes, counted.inner_nodes, report);
  return report;
}

}  // namespace voxdag::query
