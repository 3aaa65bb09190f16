#include "core/backend/cpu/subvolume_build.h"

#include "core/backend/for_each_triangle.h"
#include "core/base/host_device.h"

namespace voxdag::cpu {
namespace {

// Max triangles of a tile for which the plane memo can be faster than drawing.
constexpr size_t kFewTriangles = 4;

LatticeCube box_of(const SubvolumeTask& task) { return lattice_cube(task.cube, task.grid_levels); }

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
      full_(tables_),
      reducer_(tables_, full_, kernels),
      planes_(memory, tables_, full_, reducer_, kernels, task.rule) {
  if (task_.solid != nullptr) solid_.emplace(task_, kernels, memory, tables_, full_);
}

SubDagSummary SubvolumeBuild::run(TriangleStream& stream, SubDagSink& sink) {
  if (size_log2_of(task_) <= kTileLog2) {
    build_streamed(stream);
  } else {
    read(stream);
    if (solid_)
      finish_solid_root(build_solid(size_log2_of(task_), box_of(task_), 0, entries_used_));
    else
      build(size_log2_of(task_), box_of(task_), 0, entries_used_);
    triangles_.clear();
    entries_ = {};
    octants_ = {};
  }
  SubDagSummary summary = emit_levels(tables_, task_.shape(), sink);
  if (solid_) {
    summary.interior = solid_->filled().filled;
    summary.disputed = solid_->filled().disputed;
  }
  return summary;
}

NodeRef SubvolumeBuild::build_streamed(TriangleStream& stream) {
  const LatticeCube box = box_of(task_);
  const auto visit_all = [&](const auto& visit) {
    stream.rewind();
    for_each_triangle(stream, cancel_, visit);
  };
  if (solid_) solid_->begin_tile(box);
  visit_all([&](const FixedTriangle& triangle) {
    draw(axis_major(triangle), box);
    if (solid_) solid_->add(triangle);
  });
  if (solid_) {
    solid_->finish_views();
    if (!solid_->fill(tile_, size_log2_of(task_), box, visit_all))
      return finish_solid_root({{}, true});
  }
  return reducer_.reduce_bricks(tile_, size_log2_of(task_),
                                solid_ ? solid_->full_blocks() : nullptr);
}

void SubvolumeBuild::read(TriangleStream& stream) {
  const LatticeCube box = box_of(task_);
  stream.rewind();
  for_each_triangle(stream, cancel_, [&](const FixedTriangle& fixed) {
    if (const WideTriangle triangle = axis_major(fixed); !box.misses(triangle))
      triangles_.add(triangle);
  });
  const uint32_t narrow = triangles_.narrow_count(), wide = triangles_.wide_count();
  entries_used_ = size_t{narrow} + wide;
  reserve_entries(entries_used_);
  for (uint32_t i = 0; i < narrow; ++i) entries_[i] = {i};
  for (uint32_t i = 0; i < wide; ++i) entries_[narrow + i] = {i | Entry::kWide};
}

void SubvolumeBuild::reserve_entries(size_t count) {
  if (count > entries_.size()) entries_.grow(memory_, count);
}

const Entry* SubvolumeBuild::covering(size_t first, size_t count) const {
  if (count > kFewTriangles) return nullptr;
  const Entry* const begin = &entries_[first];
  const Entry* found = begin;
  while (found != begin + count && !found->inside()) ++found;
  if (found == begin + count) return nullptr;
  for (const Entry* other = begin; other != begin + count; ++other)
    if (other != found && (other->wide() || found->wide() ||
                           !is_in_plane(triangles_.narrow(*other), triangles_.narrow(*found))))
      return nullptr;
  return found;
}

NodeRef SubvolumeBuild::build(int size_log2, const LatticeCube& cube, size_t first, size_t count) {
  if (count == 0) return {};
  if (const Entry* const entry = covering(first, count)) {
    NodeRef node;
    if (planes_.build(triangles_, *entry, cube, size_log2, node)) return node;
  }
  if (size_log2 <= kTileLog2 && !is_worth_splitting(size_log2, first, count))
    return build_tile(size_log2, cube, first, count);
  const size_t below = entries_used_;
  const ChildEntries entries = push_children(cube, first, count);
  NodeRef children[8];
  for (int c = 0; c < 8; ++c)
    children[c] = build(size_log2 - 1, cube.child(c), entries.first[c], entries.counts[c]);
  entries_used_ = below;
  return tables_.add_node(size_log2, children);
}

SubvolumeBuild::SolidNode SubvolumeBuild::build_solid(int size_log2, const LatticeCube& cube,
                                                      size_t first, size_t count) {
  if (count == 0) return {{}, true};
  if (size_log2 == kTileLog2) {
    SolidNode node;
    // Does not use covering(), because the crossings of other triangles would also count.
    if (count == 1 && entries_[first].inside() && build_solid_plane(cube, entries_[first], node))
      return node;
    return build_solid_tile(cube, first, count);
  }
  return split_solid(size_log2, cube, first, count,
                     [this](auto... child) { return build_solid(child...); });
}

template <class BuildChild>
SubvolumeBuild::SolidNode SubvolumeBuild::split_solid(int size_log2, const LatticeCube& cube,
                                                      size_t first, size_t count,
                                                      BuildChild build_child) {
  const size_t below = entries_used_;
  const ChildEntries entries = push_children(cube, first, count);
  SolidNode children[8];
  UnitViews views[8];
  bool is_empty = true;
  for (int c = 0; c < 8; ++c) {
    const LatticeCube child = cube.child(c);
    children[c] = build_child(size_log2 - 1, child, entries.first[c], entries.counts[c]);
    is_empty &= children[c].is_empty;
    // Reads the views now, because building the next children advances the running views
    // (running_rows.h).
    if (children[c].is_empty) views[c] = solid_->empty_cube(child);
  }
  entries_used_ = below;
  if (is_empty) return {{}, true};
  NodeRef nodes[8];
  for (int c = 0; c < 8; ++c)
    nodes[c] = children[c].is_empty ? solid_->decide(views[c], size_log2 - 1) : children[c].node;
  return {tables_.add_node(size_log2, nodes), false};
}

bool SubvolumeBuild::build_solid_plane(const LatticeCube& tile, Entry entry, SolidNode& node) {
  const auto found = planes_.find_plane(triangles_, entry, kTileLog2);
  if (!found) return false;
  const Plane& plane = found->plane;
  int64_t f;
  node.is_empty = !plane.offset_from(tile, kTileLog2, f);
  if (node.is_empty) return true;
  const int axis = plane.n[0] != 0 ? 0 : plane.n[1] != 0 ? 1 : 2;
  const int sign = entry.wide() ? normal_sign(triangles_.wide(entry), axis)
                                : normal_sign(triangles_.narrow(entry), axis);
  if (sign == 0) return false;
  const auto sides = solid_->read_plane(plane, f, (sign > 0) != (plane.n[axis] > 0), tile);
  uint64_t filled;
  if (!sides || !planes_.build_tile(*found, sides->inner, f, kTileLog2, node.node, filled))
    return false;
  solid_->pass_plane(*sides, filled);
  return true;
}

SubvolumeBuild::SolidNode SubvolumeBuild::build_solid_tile(const LatticeCube& tile, size_t first,
                                                           size_t count) {
  cancel_.check();
  solid_->begin_tile(tile);
  visit(first, count, [&](const FixedTriangle& triangle) { solid_->add(triangle); });
  solid_->finish_views();
  return build_solid_part(kTileLog2, tile, first, count);
}

SubvolumeBuild::SolidNode SubvolumeBuild::build_solid_part(int size_log2, const LatticeCube& cube,
                                                           size_t first, size_t count) {
  if (count == 0) return {{}, true};
  SolidNode node;
  if (const Entry* const entry = covering(first, count);
      entry != nullptr && build_solid_part_plane(size_log2, cube, *entry, node))
    return node;
  if (!is_worth_splitting(size_log2, first, count))
    return draw_solid_part(size_log2, cube, first, count);
  return split_solid(size_log2, cube, first, count,
                     [this](auto... child) { return build_solid_part(child...); });
}

bool SubvolumeBuild::build_solid_part_plane(int size_log2, const LatticeCube& cube, Entry entry,
                                            SolidNode& node) {
  const auto found = planes_.find_plane(triangles_, entry, size_log2);
  if (!found) return false;
  int64_t f;
  node.is_empty = !found->plane.offset_from(cube, size_log2, f);
  if (node.is_empty) return true;
  const auto sides = solid_->read_part_plane(found->plane, f, cube);
  uint64_t filled;
  if (!sides || !planes_.build_tile(*found, sides->inner, f, size_log2, node.node, filled))
    return false;
  solid_->pass_part(*sides, filled);
  return true;
}

SubvolumeBuild::SolidNode SubvolumeBuild::draw_solid_part(int size_log2, const LatticeCube& cube,
                                                          size_t first, size_t count) {
  for (size_t i = first; i < first + count; ++i) draw(entries_[i], cube);
  const auto visit_all = [&](const auto& see) { visit(first, count, see); };
  if (!solid_->fill(tile_, size_log2, cube, visit_all)) return {{}, true};
  return {reducer_.reduce_bricks(tile_, size_log2, solid_->full_blocks()), false};
}

template <class See>
void SubvolumeBuild::visit(size_t first, size_t count, const See& see) const {
  for (size_t i = first; i < first + count; ++i) {
    const Entry entry = entries_[i];
    see(entry.wide() ? vertex_major(triangles_.wide(entry))
                     : vertex_major(triangles_.narrow(entry)));
  }
}

NodeRef SubvolumeBuild::finish_solid_root(const SolidNode& root) {
  if (!root.is_empty) return root.node;
  return solid_->decide(solid_->empty_cube(box_of(task_)), size_log2_of(task_));
}

SubvolumeBuild::ChildEntries SubvolumeBuild::push_children(const LatticeCube& cube, size_t first,
                                                           size_t count) {
  if (count > octants_.size()) octants_.grow(memory_, count);
  ChildEntries out;
  for (size_t i = 0; i < count; ++i) {
    const Octants octants = test_octants(entries_[first + i], cube);
    octants_[i] = static_cast<uint16_t>(octants.touched | octants.inside << 8);
    for (uint32_t rest = octants.touched; rest != 0; rest &= rest - 1)
      ++out.counts[lowest_bit(rest)];
  }
  size_t next[8];
  for (int c = 0; c < 8; ++c) {
    out.first[c] = next[c] = entries_used_;
    entries_used_ += out.counts[c];
  }
  reserve_entries(entries_used_);
  for (size_t i = 0; i < count; ++i) {
    const uint32_t bits = entries_[first + i].bits & ~Entry::kInside;
    for (uint32_t rest = octants_[i] & 0xff; rest != 0; rest &= rest - 1) {
      const int c = lowest_bit(rest);
      entries_[next[c]++] = {bits | (octants_[i] >> (8 + c) & 1 ? Entry::kInside : 0)};
    }
  }
  return out;
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
  if (is_narrow(triangle))
    draw_narrow(narrowed(triangle), false, tile);
  else
    draw_wide(triangle, false, tile);
}

void SubvolumeBuild::draw(Entry entry, const LatticeCube& tile) {
  if (entry.wide())
    draw_wide(triangles_.wide(entry), entry.inside(), tile);
  else
    draw_narrow(triangles_.narrow(entry), entry.inside(), tile);
}

void SubvolumeBuild::draw_narrow(const NarrowTriangle& triangle, bool inside,
                                 const LatticeCube& tile) {
  if (task_.rule == VoxelRule::kThin) {
    ThinTriangle<int32_t> thin;
    if (thin.set_up(triangle, inside, tile)) kernels_.draw_thin(thin, tile_);
  } else {
    TileTriangle<int32_t> touched;
    if (touched.set_up(triangle, inside, tile)) kernels_.draw(touched, tile_);
  }
}

void SubvolumeBuild::draw_wide(const WideTriangle& triangle, bool inside, const LatticeCube& tile) {
  if (task_.rule == VoxelRule::kThin) {
    ThinTriangle<int64_t> thin;
    if (thin.set_up(triangle, inside, tile)) draw_thin_wide(thin, tile_);
  } else {
    TileTriangle<int64_t> touched;
    if (touched.set_up(triangle, inside, tile)) cpu::draw_wide(touched, tile_);
  }
}

}  // namespace voxdag::cpu
