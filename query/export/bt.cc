// Writes OctoMap's binary octree (Hornung et al. 2013): a text header, and then two bytes for each
// inner node, depth first. Bits 2i and 2i + 1 of the two bytes are the state of child i, as a
// number: 0 unknown, 1 free, 2 occupied, 3 an inner node. Child x + 2y + 4z is at (x, y, z), where
// each coordinate is 0 or 1. This code does not use the OctoMap library, because the library would
// store all nodes in memory.
//
// The octree has 16 levels. The origin of its coordinates is in its middle. The exporter rounds the
// position of the grid to cells, so that the origin of the octree is at most half a voxel from the
// origin of the scene. After this shift, octree cubes are in general not cubes of the grid. So the
// exporter reads the cells of one octree block after the other, 32^3 cells each, and makes the
// nodes from these cells.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <optional>
#include <vector>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/geometry/morton.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

constexpr uint32_t kOctoMapLevels = 16;
constexpr uint64_t kNodeBytes = 2;
enum BtChild : uint32_t { kUnknown = 0, kFree = 1, kOccupied = 2, kInner = 3 };

// Edge of the octree blocks whose cells are in memory at the same time, in cells.
constexpr int64_t kBlockEdge = 32;
constexpr uint32_t kBlockLevels = 5;
constexpr int64_t kHalfTree = int64_t{1} << (kOctoMapLevels - 1);

// Returns the octree position of the grid's low corner, in cells from the octree's origin.
Position place_of(const ExportJob& job) {
  Position place{};
  const int64_t edge = int64_t{1} << job.selection.grid_levels;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double cells = std::floor(job.origin(axis) / job.cell_edge() + 0.5);
    place[axis] = static_cast<int64_t>(
        std::clamp(cells, static_cast<double>(-kHalfTree), static_cast<double>(kHalfTree - edge)));
  }
  return place;
}

// The content of an octree cube: no set cells, some, or only set cells.
enum class Content : uint8_t { kNothing, kSomething, kFull };

// The cells of one block of the octree, as bits in Morton order. The lowest bit of an index is the
// lowest bit of x.
class BlockCells {
 public:
  // `place` is place_of(job).
  BlockCells(const ExportJob& job, const Position& place) : job_(job), place_(place) {}

  // Reads the selected cells of the block whose low corner is `corner`, in cells from the octree's
  // origin. `region` is the selected part of the block, in cells of the grid. Returns the number of
  // set cells.
  uint64_t read(const Position& corner, const Region& region) {
    cells_.fill(0);
    uint64_t count = 0;
    if (region.empty()) return 0;
    for_each_brick(job_.dag, {job_.selection.grid_levels, region}, [&](const Brick& brick) {
      for_each_cell_of(brick, [&](const Position& cell) {
        std::array<uint32_t, 3> at{};
        for (size_t axis = 0; axis < 3; ++axis)
          at[axis] = static_cast<uint32_t>(cell[axis] + place_[axis] - corner[axis]);
        const uint64_t index = morton_encode(at[2], at[1], at[0]);
        cells_[index / 64] |= uint64_t{1} << index % 64;
        ++count;
      });
    });
    return count;
  }
  // Returns the content of a cube of edge^3 cells in the block. `index` is the index of the first
  // cell of the cube.
  Content content(uint64_t index, int64_t edge) const {
    const uint64_t count = cells_of_cube(edge);
    if (count < 64) {
      const uint64_t all = (uint64_t{1} << count) - 1;
      const uint64_t bits = cells_[index / 64] >> index % 64 & all;
      return bits == 0 ? Content::kNothing : bits == all ? Content::kFull : Content::kSomething;
    }
    uint64_t any = 0, all = ~uint64_t{0};
    for (uint64_t i = index / 64; i < (index + count) / 64; ++i) {
      any |= cells_[i];
      all &= cells_[i];
    }
    return any == 0 ? Content::kNothing : ~all == 0 ? Content::kFull : Content::kSomething;
  }

 private:
  const ExportJob& job_;
  const Position place_;
  std::array<uint64_t, (size_t{1} << 3 * kBlockLevels) / 64> cells_{};
};

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
      : job_(job), write_(std::move(write)), place_(place_of(job)), cells_(job, place_) {
    for (size_t axis = 0; axis < 3; ++axis) {
      region_.low[axis] = job.selection.region.low[axis] + place_[axis];
      region_.high[axis] = job.selection.region.high[axis] + place_[axis];
    }
  }
  uint64_t nodes = 1, inner_nodes = 0, voxels = 0;  // `nodes` includes the root

  void run() { write_upper({-kHalfTree, -kHalfTree, -kHalfTree}, int64_t{1} << kOctoMapLevels); }

 private:
  static constexpr int64_t kBufferedEdge = 512;
  // A cube without voxels that is only partly in the region is divided until its parts have this
  // edge, in cells, so that the parts in the region can be free.
  static constexpr int64_t kKnownEdge = 8;
  // The states of the children of one node: the two bytes of the node, and whether all children are
  // full.
  struct Children {
    uint32_t bits = 0;
    bool all_full = true;
  };

  static Position octomap_corner(const Position& corner, int child, int64_t edge) {
    return {corner[0] + (child & 1 ? edge : 0), corner[1] + (child & 2 ? edge : 0),
            corner[2] + (child & 4 ? edge : 0)};
  }
  // Returns the intersection of the selected region and the octree cube, in cells of the grid.
  Region part_of(const Position& corner, int64_t edge) const {
    Region region = job_.selection.region;
    for (size_t axis = 0; axis < 3; ++axis) {
      const int64_t low = corner[axis] - place_[axis];
      region.low[axis] = std::max(region.low[axis], low);
      region.high[axis] = std::min(region.high[axis], low + edge);
    }
    return region;
  }
  // True if the cube is only partly in the region, and an octree cube of kKnownEdge cells per edge
  // is in both.
  bool has_known_part(const Position& corner, int64_t edge) const {
    if (region_.contains(corner, edge)) return false;
    for (size_t axis = 0; axis < 3; ++axis) {
      const int64_t low = std::max(region_.low[axis], corner[axis]) + kKnownEdge - 1;
      const int64_t high = std::min(region_.high[axis], corner[axis] + edge);
      if ((low & -kKnownEdge) >= (high & -kKnownEdge)) return false;
    }
    return true;
  }
  bool has_voxels(const Position& corner, int64_t edge) const {
    bool found = false;
    for_each_brick(job_.dag, {job_.selection.grid_levels, part_of(corner, edge)},
                   [&](const Brick&) { return !(found = true); });
    return found;
  }

  void write_upper(const Position& corner, int64_t edge) {
    if (edge == kBufferedEdge) {
      add_nodes(corner, edge, true);
      write_(buffer_);
      return buffer_.clear();
    }
    Children children;
    for (int child = 0; child < 8; ++child) {
      const Position at = octomap_corner(corner, child, edge / 2);
      add(child, has_voxels(at, edge / 2) ? Content::kSomething : Content::kNothing, at, edge / 2,
          children);
    }
    ++inner_nodes;
    const std::array<uint8_t, 2> bits = bytes_of(children);
    write_(bits);
    for (int child = 0; child < 8; ++child)
      if ((children.bits >> 2 * child & 3) == kInner)
        write_upper(octomap_corner(corner, child, edge / 2), edge / 2);
  }

  // Adds the nodes of a cube to the buffer, and returns its content. Adds no nodes for a cube that
  // is full, or that has no voxels unless has_known_part() is true: the node of its parent has its
  // state. With `is_top`, always adds at least one node.
  Content add_nodes(const Position& corner, int64_t edge, bool is_top) {
    if (!is_top && edge == kBlockEdge) return add_block(corner);
    if (!is_top && !has_voxels(corner, edge) && !has_known_part(corner, edge))
      return Content::kNothing;
    const size_t begin = buffer_.size();
    const uint64_t nodes_before = nodes;
    buffer_.insert(buffer_.end(), {0, 0});
    Children children;
    for (int child = 0; child < 8; ++child) {
      const Position at = octomap_corner(corner, child, edge / 2);
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
    const uint64_t count = cells_.read(corner, part_of(corner, kBlockEdge));
    voxels += count;
    if (count == 0 && !has_known_part(corner, kBlockEdge)) return Content::kNothing;
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
      const Position at = octomap_corner(corner, child, half);
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
    else if (content != Content::kNothing || has_known_part(corner, edge))
      state = kInner;
    nodes += state != kUnknown;
    children.bits |= state << 2 * child;
    children.all_full = children.all_full && content == Content::kFull;
    return state == kInner;
  }
  static std::array<uint8_t, 2> bytes_of(const Children& children) {
    return {static_cast<uint8_t>(children.bits), static_cast<uint8_t>(children.bits >> 8)};
  }

  const ExportJob& job_;
  const Write write_;
  const Position place_;
  Region region_;  // the selected region, in cells from the octree's origin
  BlockCells cells_;
  std::vector<uint8_t> buffer_;
};

std::string bt_header(uint64_t nodes, double cell_edge) {
  return "# Octomap OcTree binary file\n# written by voxdag\nid OcTree\nsize " +
         std::to_string(nodes) + "\nres " + number_text(cell_edge) + "\ndata\n";
}

// Returns the translation that converts coordinates of the octree to coordinates of the scene.
std::array<double, 3> translation_of(const ExportJob& job) {
  const Position place = place_of(job);
  std::array<double, 3> translation{};
  for (size_t axis = 0; axis < 3; ++axis)
    translation[axis] = job.world(axis, static_cast<double>(-place[axis]));
  return translation;
}

std::string translation_note(const ExportJob& job, const std::array<double, 3>& translation) {
  const bool is_near = std::ranges::all_of(translation, [&](double distance) {
    return std::abs(distance) <= job.cell_edge() / 2 * (1 + 1e-9);
  });
  char text[240];
  std::snprintf(text, sizeof(text),
                is_near ? "its coordinates are those of the scene, up to half a voxel: add %.9g, "
                          "%.9g, %.9g for the exact ones"
                        : "the scene is too far from its origin for OctoMap: add %.9g, %.9g, %.9g "
                          "to its coordinates to get scene units",
                translation[0], translation[1], translation[2]);
  return text;
}

// Returns the memory that the OctoMap library allocates to read the file: an object for each node
// and an array of pointers for each inner node, including the overhead of the allocator.
uint64_t reader_bytes(uint64_t nodes, uint64_t inner_nodes) {
  return nodes * 32 + inner_nodes * 80;
}

}  // namespace

ExportReport write_bt(const ExportJob& job) {
  if (job.selection.grid_levels > kOctoMapLevels)
    throw Error(ErrorCode::kLimit, job.output + ": the grid has " +
                                       std::to_string(int64_t{1} << job.selection.grid_levels) +
                                       " voxels per edge, but OctoMap has at most 65536. " +
                                       coarser_options(job, kOctoMapLevels) + " fits");
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
  const std::array<double, 3> translation = translation_of(job);
  const uint64_t memory = reader_bytes(counted.nodes, counted.inner_nodes);
  report.notes.push_back(translation_note(job, translation));
  report.notes.push_back("its readers need about " + size_text(memory) + " of memory for " +
                         count_text(counted.nodes) + " nodes");
  report.facts.push_back({"translation", {translation.begin(), translation.end()}});
  report.add_fact("nodes", counted.nodes);
  report.add_fact("reader_memory_bytes", memory);
  return report;
}

}  // namespace voxdag::query
