#include "core/backend/cpu/subvolume_build.h"

#include "core/base/host_device.h"

namespace voxdag::cpu {
namespace {

constexpr size_t kBatch = 256;  // triangles per read
// Max triangles of a tile for which the plane memo may be faster than drawing.
constexpr size_t kFewTriangles = 4;

LatticeCube box_of(const SubvolumeTask& task) {
  LatticeCube box;
  box.edge = task.cube.edge_voxels(task.grid_levels) * kUnitsPerVoxel;
  for (int a = 0; a < 3; ++a) box.low[a] = task.cube.position[a] * box.edge;
  return box;
}

int size_log2_of(const SubvolumeTask& task) {
  return static_cast<int>(task.grid_levels - task.cube.level);
}

}  // namespace

SubvolumeBuild::SubvolumeBuild(const SubvolumeTask& task, const Kernels& kernels,
                               PooledMemory& memory, const CancelToken& cancel,
                               const TableSizes& expected)
    : task_(task),
      kernels_(kernels),
      memory_(memory),
      cancel_(cancel),
      triangles_(memory),
      tables_(memory, size_log2_of(task), expected),
      reducer_(tables_, kernels),
      planes_(memory, tables_, reducer_, kernels) {}

SubDagSummary SubvolumeBuild::run(TriangleStream& stream, SubDagSink& sink) {
  stream.rewind();
  if (size_log2_of(task_) <= kTileLog2) {
    build_streamed(stream);
  } else {
    read(stream);
    build(size_log2_of(task_), box_of(task_), 0, entries_used_);
    triangles_.clear();
    entries_ = {};
    octants_ = {};
  }
  return emit_levels(tables_, task_.shape(), sink);
}

NodeRef SubvolumeBuild::build_streamed(TriangleStream& stream) {
  const LatticeCube box = box_of(task_);
  std::vector<FixedTriangle> batch(kBatch);
  while (const size_t count = stream.read(batch)) {
    cancel_.check();
    for (size_t i = 0; i < count; ++i) draw(axis_major(batch[i]), box);
  }
  return reducer_.reduce_bricks(tile_, size_log2_of(task_));
}

void SubvolumeBuild::read(TriangleStream& stream) {
  const LatticeCube box = box_of(task_);
  std::vector<FixedTriangle> batch(kBatch);
  while (const size_t count = stream.read(batch)) {
    cancel_.check();
    for (size_t i = 0; i < count; ++i)
      if (const WideTriangle triangle = axis_major(batch[i]); !box.misses(triangle))
        triangles_.add(triangle);
  }
  const uint32_t narrow = triangles_.narrow_count(), wide = triangles_.wide_count();
  entries_used_ = size_t{narrow} + wide;
  reserve_entries(entries_used_);
  for (uint32_t i = 0; i < narrow; ++i) entries_[i] = {i};
  for (uint32_t i = 0; i < wide; ++i) entries_[narrow + i] = {i | Entry::kWide};
}

void SubvolumeBuild::reserve_entries(size_t count) {
  if (count > entries_.size()) entries_.grow(memory_, count);
}

NodeRef SubvolumeBuild::build(int size_log2, const LatticeCube& cube, size_t first, size_t count) {
  if (count == 0) return {};
  if (NodeRef node; count == 1 && entries_[first].inside() &&
                    planes_.build(triangles_, entries_[first], cube, size_log2, node))
    return node;
  if (size_log2 <= kTileLog2 && !is_worth_splitting(size_log2, first, count))
    return build_tile(size_log2, cube, first, count);
  if (count > octants_.size()) octants_.grow(memory_, count);
  size_t counts[8] = {};
  for (size_t i = 0; i < count; ++i) {
    const Octants octants = test_octants(entries_[first + i], cube);
    octants_[i] = static_cast<uint16_t>(octants.touched | octants.inside << 8);
    for (uint32_t rest = octants.touched; rest != 0; rest &= rest - 1) ++counts[lowest_bit(rest)];
  }
  const size_t below = entries_used_;
  size_t next[8];
  for (int c = 0; c < 8; ++c) {
    next[c] = entries_used_;
    entries_used_ += counts[c];
  }
  reserve_entries(entries_used_);
  for (size_t i = 0; i < count; ++i) {
    const uint32_t bits = entries_[first + i].bits & ~Entry::kInside;
    for (uint32_t rest = octants_[i] & 0xff; rest != 0; rest &= rest - 1) {
      const int c = lowest_bit(rest);
      entries_[next[c]++] = {bits | (octants_[i] >> (8 + c) & 1 ? Entry::kInside : 0)};
    }
  }
  NodeRef children[8];
  for (int c = 0; c < 8; ++c)
    children[c] = build(size_log2 - 1, cube.child(c), next[c] - counts[c], counts[c]);
  entries_used_ = below;
  return tables_.add_node(size_log2, children);
}

bool SubvolumeBuild::is_worth_splitting(int size_log2, size_t first, size_t count) {
  if (size_log2 <= PlaneMemo::kSmallestLog2 || count > kFewTriangles) return false;
  for (size_t i = 0; i < count; ++i)
    if (!planes_.has_plane(triangles_, entries_[first + i])) return false;
  return true;
}

NodeRef SubvolumeBuild::build_tile(int size_log2, const LatticeCube& cube, size_t first,
                                   size_t count) {
  cancel_.check();
  for (size_t i = 0; i < count; ++i) draw(entries_[first + i], cube);
  return reducer_.reduce_bricks(tile_, size_log2);
}

Octants SubvolumeBuild::test_octants(Entry entry, const LatticeCube& cube) const {
  return entry.wide() ? test_octants_wide(triangles_.wide(entry), cube, entry.inside())
                      : kernels_.test_octants(triangles_.narrow(entry), cube, entry.inside());
}

void SubvolumeBuild::draw(const WideTriangle& triangle, const LatticeCube& tile) {
  if (is_narrow(triangle)) {
    TileTriangle<int32_t> narrow;
    if (narrow.set_up(narrowed(triangle), false, tile)) kernels_.draw(narrow, tile_);
  } else {
    TileTriangle<int64_t> wide;
    if (wide.set_up(triangle, false, tile)) draw_wide(wide, tile_);
  }
}

void SubvolumeBuild::draw(Entry entry, const LatticeCube& tile) {
  if (entry.wide()) {
    TileTriangle<int64_t> wide;
    if (wide.set_up(triangles_.wide(entry), entry.inside(), tile)) draw_wide(wide, tile_);
  } else {
    TileTriangle<int32_t> narrow;
    if (narrow.set_up(triangles_.narrow(entry), entry.inside(), tile)) kernels_.draw(narrow, tile_);
  }
}

}  // namespace voxdag::cpu
