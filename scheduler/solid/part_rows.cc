#include "scheduler/solid/part_rows.h"

#include "core/backend/for_each_triangle.h"
#include "core/geometry/overlap.h"
#include "scheduler/solid/row_sums.h"

namespace voxdag {
namespace {

// Computes the views (core/geometry/solid_rule.h) from the low faces of a part. Starts with the
// views on the same rows from the low faces of the split subvolume. Updates them by the crossings
// between the low faces of the subvolume and of the part.
class PartEntry {
 public:
  PartEntry(const SolidEntry& whole_entry, const SampleRows& whole, const SampleRows& part)
      : rule_(whole_entry.rule), part_(part) {
    int first[3];  // the part's position in the subvolume, in blocks
    for (int a = 0; a < 3; ++a)
      first[a] = static_cast<int>((part.low[a] - whole.low[a]) >> part.pitch_log2);
    for (int a = 0; a < 3; ++a) {
      blocks_before_[a] = first[a];
      const int f = first[first_row_axis(a)], s = first[second_row_axis(a)];
      for (int i = 0; i <= part.blocks; ++i)
        for (int j = 0; j <= part.blocks; ++j)
          views_[a].push_back(whole_entry.views[a][whole.index(f + i, s + j)]);
    }
  }
  void add(const FixedTriangle& triangle) {
    for (int a = 0; a < 3; ++a)
      if (blocks_before_[a] != 0)
        part_.for_each_crossing(triangle, a, [&](int i, int j, int64_t block, int sign) {
          if (block >= 0 || block < -blocks_before_[a]) return;
          int32_t& view = views_[a][part_.index(i, j)];
          view = view_after(rule_, view, sign);
        });
  }
  const std::vector<int32_t>& views(int axis) const { return views_[axis]; }

 private:
  const SolidRule rule_;
  const SampleRows part_;
  int blocks_before_[3];
  std::vector<int32_t> views_[3];
};

}  // namespace

void add_part_rows(SolidRows& rows, const Cube& whole, std::span<const Cube> parts,
                   TriangleStream& triangles, MemoryBudget& budget, const CancelToken& cancel) {
  const uint32_t levels = rows.grid_levels();
  const MemoryCharge charge(budget, row_bytes(whole, levels) + 2 * row_bytes(parts.front(), levels),
                            "the sample rows of a solid");
  const SolidEntry entry = rows.read_entry(whole);
  const SampleRows whole_rows = sample_rows_of(whole, levels);
  for (const Cube& part : parts) {
    const SampleRows part_rows = sample_rows_of(part, levels);
    const int64_t edge = part.edge_voxels(levels) * kUnitsPerVoxel;
    PartEntry views(entry, whole_rows, part_rows);
    SubvolumeRows added;
    added.unit = SolidUnit::kEmptyUnit;
    triangles.rewind();
    for_each_triangle(triangles, cancel, [&](const FixedTriangle& triangle) {
      if (added.unit != SolidUnit::kShell && triangle_touches_cube(triangle, part_rows.low, edge))
        added.unit = SolidUnit::kShell;
      views.add(triangle);
    });
    for (int a = 0; a < 3; ++a) added.views[a] = rows.file().append_rows(views.views(a));
    rows.add(part, added);
  }
  rows.save();
}

UnitViews views_of_empty(const SolidEntry& entry, const Cube& cube, uint32_t grid_levels) {
  const SampleRows rows = sample_rows_of(cube, grid_levels);
  UnitViews unit;
  for (int c = 0; c < 8; ++c) {
    int64_t views = 0;
    for (int a = 0; a < 3; ++a) {
      const int i = child_coordinate(c, first_row_axis(a)) * rows.blocks;
      const int j = child_coordinate(c, second_row_axis(a)) * rows.blocks;
      views += entry.views[a][rows.index(i, j)];
    }
    unit.add(views);
  }
  return unit;
}

}  // namespace voxdag
