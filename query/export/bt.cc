// Writes OctoMap's binary octree (Hornung et al. 2013): a text header, then two bytes for each
// inner node, depth first. Bits 2i and 2i + 1 of these bytes describe child i: 01 (only bit 2i is
// set) is free, 10 occupied, 11 an inner node, 00 unknown. Child x + 2y + 4z is the child at (x, y,
// z), where each coordinate is 0 or 1. This code does not use the OctoMap library, because the
// library would store all nodes in memory.
//
// The octree has 16 levels, and the origin of its coordinates is in its middle. A grid of fewer
// than 2^16 cells per edge has its low corner at this origin. A grid of 2^16 cells per edge fills
// the octree, so its low corner is the octree's low corner.
#include <array>
#include <cstdio>
#include <optional>

#include "core/base/error.h"
#include "core/base/text.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

constexpr uint32_t kOctoMapLevels = 16;
enum BtChild : uint32_t { kUnknown = 0, kFree = 1, kOccupied = 2, kInner = 3 };

// Walks the octree depth first. A full cube of at least 8 cells per edge is one occupied leaf.
// Inside the region, cubes without voxels are written as free, even inside closed objects: a
// surface does not show which of its sides is solid (docs/export.md).
template <class Inner>
class BtWalk {
 public:
  // Calls inner(bits) for each inner node, in order.
  BtWalk(const ExportJob& job, Inner& inner) : job_(job), inner_(inner) {}
  uint64_t nodes = 0, voxels = 0;

  void run() {
    const uint32_t levels = job_.selection.grid_levels;
    ++nodes;  // the root
    // Writes the nodes above the grid. The root's child is the octant whose low corner is the
    // origin. On every lower level, the child is at the low corner of its parent.
    for (uint32_t level = kOctoMapLevels; level > levels; --level) {
      inner_(kInner << (level == kOctoMapLevels ? 14 : 0));
      ++nodes;
    }
    below(0, job_.dag.root(), {0, 0, 0});
  }

 private:
  // True if a cube has selected cells.
  bool has_cells(uint32_t depth, uint64_t content, const Position& corner, int64_t edge) const {
    const Region& region = job_.selection.region;
    if (!region.intersects(corner, edge)) return false;
    if (region.contains(corner, edge)) return true;
    const DagView::Children children = job_.dag.children(depth, content);
    for (int i = 0; i < 8; ++i)
      if (children.has(i) && has_cells(depth + 1, job_.dag.content(depth, children, i),
                                       child_corner(corner, i, edge / 2), edge / 2))
        return true;
    return false;
  }

  void below(uint32_t depth, uint64_t content, const Position& corner) {
    const int64_t half = int64_t{1} << (job_.selection.grid_levels - depth - 1);
    const DagView::Children children = job_.dag.children(depth, content);
    uint32_t bits = 0, inner = 0;
    for (int i = 0; i < 8; ++i) {
      const Position at = child_corner(corner, i, half);
      uint32_t state = job_.selection.region.contains(at, half) ? kFree : kUnknown;
      if (children.has(i) && has_cells(depth + 1, job_.dag.content(depth, children, i), at, half)) {
        const bool is_leaf =
            half == 1 || (half > kBrickEdge && state == kFree &&
                          is_full(job_.dag, depth + 1, job_.dag.content(depth, children, i),
                                  job_.selection.grid_levels));
        state = is_leaf ? kOccupied : kInner;
        inner |= is_leaf ? 0 : 1u << i;
        voxels += is_leaf ? cells_of_cube(half) : 0;
      }
      nodes += state != kUnknown;
      bits |= state << 2 * octomap_child(i);
    }
    inner_(bits);
    // Writes the children in OctoMap's order, which is voxdag's order with x and z exchanged.
    for (int i = 0; i < 8; ++i) {
      const int ours = octomap_child(i);
      if (inner >> ours & 1)
        below(depth + 1, job_.dag.content(depth, children, ours), child_corner(corner, ours, half));
    }
  }

  static constexpr int octomap_child(int child) {
    return (child & 1) << 2 | (child & 2) | child >> 2;
  }

  const ExportJob& job_;
  Inner& inner_;
};

std::string bt_header(uint64_t nodes, double cell_edge) {
  return "# Octomap OcTree binary file\n# written by voxdag\nid OcTree\nsize " +
         std::to_string(nodes) + "\nres " + number_text(cell_edge) + "\ndata\n";
}

std::string translation_note(const ExportJob& job) {
  const double shift = job.selection.grid_levels == kOctoMapLevels
                           ? static_cast<double>(int64_t{1} << (kOctoMapLevels - 1))
                           : 0;
  char text[160];
  std::snprintf(text, sizeof(text), "add %.9g, %.9g, %.9g to its coordinates to get scene units",
                job.world(0, shift), job.world(1, shift), job.world(2, shift));
  return text;
}

}  // namespace

ExportReport write_bt(const ExportJob& job) {
  if (job.selection.grid_levels > kOctoMapLevels)
    throw Error(ErrorCode::kLimit, job.output + ": the grid has " +
                                       std::to_string(int64_t{1} << job.selection.grid_levels) +
                                       " voxels per edge, but OctoMap has at most 65536. " +
                                       coarser_options(job, kOctoMapLevels) + " fits");
  uint64_t inner_nodes = 0;
  std::optional<ExportStage> counting(std::in_place, job, "count", 0, "nodes");
  const auto count = [&](uint32_t) {
    ++inner_nodes;
    counting->advance(1);
  };
  BtWalk<const decltype(count)> counted(job, count);
  counted.run();
  counting.reset();
  if (counted.voxels == 0) refuse_empty(job);
  const std::string header = bt_header(counted.nodes, job.cell_edge());
  require_space(job, header.size() + 2 * inner_nodes);
  ExportReport report;
  report.voxels = counted.voxels;
  ExportFile file(job.files, job.output);
  file.write(header);
  ExportStage stage(job, "export", inner_nodes, "nodes");
  const auto put = [&](uint32_t bits) {
    file.put(static_cast<uint16_t>(bits));
    stage.advance(1);
  };
  BtWalk<const decltype(put)>(job, put).run();
  ExportFile* const written[] = {&file};
  report.bytes = publish(job, written);
  report.notes.push_back(translation_note(job));
  report.notes.push_back("its readers need about " + size_text(counted.nodes * 16) +
                         " of memory for " + count_text(counted.nodes) + " nodes");
  return report;
}

}  // namespace voxdag::query
