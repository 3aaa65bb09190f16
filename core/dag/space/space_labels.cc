#include "core/dag/space/space_labels.h"

#include <algorithm>

#include "core/base/memory_budget.h"
#include "core/dag/space/face_relations.h"

namespace voxdag {
namespace {

constexpr int kOctants = 8;
constexpr uint32_t kNone = UINT32_MAX;
// Maximum total number of components of a node's octants, so that the 16-bit numbers in
// SpaceLabels::Depth::maps are sufficient.
constexpr size_t kMaxComponents = 0xfff0 - kOctants;

// Appends a value to an array of which `size` elements are used.
template <class T>
void append(PooledMemory& memory, PooledArray<T>& array, uint64_t size, T value) {
  if (size >= UINT32_MAX) throw OutOfBudget();
  if (size >= array.size()) array.grow(memory, size + 1);
  array[size] = value;
}

}  // namespace

// Computes the labels, level by level from the bricks upwards.
class SpaceLabeler {
 public:
  // `out` must have the labels of all depths below the nodes that will be labeled.
  SpaceLabeler(PooledMemory& memory, SpaceLabels& out)
      : memory_(memory), levels_(out.levels_), out_(out), relations_(memory, out) {}

  void run(const CancelToken* cancel) {
    cancel_ = cancel;
    const int bricks = levels_.brick_depth();
    out_.depths_.resize(static_cast<size_t>(bricks) + 1);
    label_bricks(out_.depths_.back());
    for (int depth = bricks; depth-- > 0;) label_nodes(depth);
  }

  std::vector<uint8_t> connected(int depth, uint32_t row, int octant, uint32_t component) {
    LabeledCube octants[kOctants];
    const size_t components = join_octants(depth, row, octants);
    std::vector<uint8_t> out(components);
    const uint32_t root = find(static_cast<uint32_t>(octants[octant].first) + component);
    for (size_t i = 0; i < components; ++i) out[i] = find(static_cast<uint32_t>(i)) == root;
    return out;
  }

 private:
  void check_cancel(uint64_t row) const {
    constexpr uint64_t kRowsPerCheck = 1024;
    if (cancel_ && row % kRowsPerCheck == 0) cancel_->check();
  }

  // Completes a row after its components were appended to `depth.touch`, which then has `used`
  // elements. `open`: the faces at which all voxels are empty.
  void end_row(SpaceLabels::Depth& depth, uint64_t row, uint64_t used, uint8_t open) {
    SpaceLabels::Row& out = depth.rows[row];
    const uint64_t count = used - out.first;
    out.count = static_cast<uint8_t>(std::min<uint64_t>(count, SpaceLabels::Row::kMany));
    out.open = open;
    for (uint64_t c = 0; c < SpaceLabels::Row::kFew; ++c)
      out.touch[c] = c < count ? depth.touch[out.first + c] : uint8_t{0};
    depth.rows[row + 1].first = static_cast<uint32_t>(used);
  }

  void label_bricks(SpaceLabels::Depth& depth) {
    depth.rows = PooledArray<SpaceLabels::Row>(memory_, levels_.brick_rows + 1);
    depth.rows[0].first = 0;
    uint64_t used = 0;
    for (uint64_t row = 0; row < levels_.brick_rows; ++row) {
      check_cancel(row);
      for_each_open_component(~levels_.bricks[row], [&](uint64_t component) {
        append(memory_, out_.brick_masks_, used, component);
        append(memory_, depth.touch, used++, brick_touch(component));
      });
      const uint8_t set = brick_touch(levels_.bricks[row]);
      end_row(depth, row, used, static_cast<uint8_t>(~set & kAllFaces));
    }
  }

  void label_nodes(int depth) {
    SpaceLabels::Depth& out = out_.depths_[static_cast<size_t>(depth)];
    const uint64_t rows = levels_.rows(depth);
    out.rows = PooledArray<SpaceLabels::Row>(memory_, rows + 1);
    out.rows[0].first = 0;
    out.first_map = PooledArray<uint32_t>(memory_, rows);
    touch_used_ = maps_used_ = 0;
    for (uint64_t row = 0; row < rows; ++row) {
      check_cancel(row);
      label_node(depth, static_cast<uint32_t>(row), out);
    }
  }

  void label_node(int depth, uint32_t row, SpaceLabels::Depth& out) {
    LabeledCube octants[kOctants];
    const size_t components = join_octants(depth, row, octants);
    number(depth + 1, octants, components);
    write_map(row, octants, components, out);
    end_row(out, row, touch_used_, open_faces(depth + 1, octants));
  }

  // Sets `octants` to a node's octants, and joins those components of the octants that meet.
  // Returns the number of components of all octants.
  size_t join_octants(int depth, uint32_t row, LabeledCube (&octants)[kOctants]) {
    elements_.clear();
    for (int o = 0; o < kOctants; ++o) {
      LabeledCube& octant = octants[o];
      octant = {levels_.has_child(depth, row, o), 0, elements_.size()};
      if (octant.exists) octant.row = levels_.child(depth, row, o);
      const uint32_t count = octant.exists ? out_.count(depth + 1, octant.row) : 1;
      for (uint32_t c = 0; c < count; ++c)
        elements_.push_back(static_cast<uint32_t>(elements_.size()));
    }
    const size_t components = elements_.size();
    if (components > kMaxComponents) throw OutOfBudget();
    parents_.assign(elements_.begin(), elements_.end());
    for (int axis = 0; axis < 3; ++axis)
      for (int o = 0; o < kOctants; ++o)
        if ((o & 4 >> axis) == 0) join(depth + 1, octants[o], octants[o | 4 >> axis], axis);
    return components;
  }

  // For each set of joined components, sets touch_ of the set's root to the faces of the node at
  // which the set has a voxel.
  void number(int below, const LabeledCube (&octants)[kOctants], size_t components) {
    touch_.assign(components, 0);
    for (int o = 0; o < kOctants; ++o) {
      const size_t end = o + 1 < kOctants ? octants[o + 1].first : components;
      for (size_t i = octants[o].first; i < end; ++i) {
        const uint8_t touch =
            octants[o].exists ? out_.touch(below, octants[o].row)[i - octants[o].first] : kAllFaces;
        touch_[find(static_cast<uint32_t>(i))] |= touch & outer_faces(o);
      }
    }
  }

  void write_map(uint32_t row, const LabeledCube (&octants)[kOctants], size_t components,
                 SpaceLabels::Depth& out) {
    if (maps_used_ + kOctants + components >= UINT32_MAX) throw OutOfBudget();
    out.first_map[row] = static_cast<uint32_t>(maps_used_);
    if (maps_used_ + kOctants + components > out.maps.size())
      out.maps.grow(memory_, maps_used_ + kOctants + components);
    uint16_t* const map = &out.maps[maps_used_];
    for (int o = 0; o < kOctants; ++o) map[o] = static_cast<uint16_t>(kOctants + octants[o].first);
    labels_.assign(components, kNone);
    uint32_t count = 0;
    for (size_t i = 0; i < components; ++i) {
      const uint32_t root = find(static_cast<uint32_t>(i));
      if (touch_[root] != 0 && labels_[root] == kNone) {
        labels_[root] = count++;
        append(memory_, out.touch, touch_used_++, touch_[root]);
      }
      map[kOctants + i] =
          labels_[root] == kNone ? SpaceLabels::kClosed : static_cast<uint16_t>(labels_[root]);
    }
    maps_used_ += kOctants + components;
  }

  uint8_t open_faces(int below, const LabeledCube (&octants)[kOctants]) const {
    uint8_t blocked = 0;
    for (int o = 0; o < kOctants; ++o)
      if (octants[o].exists)
        blocked |= static_cast<uint8_t>(outer_faces(o) & ~out_.open_faces(below, octants[o].row));
    return static_cast<uint8_t>(kAllFaces & ~blocked);
  }

  // Joins the components of two neighbors: `a` is below `b` along the axis.
  void join(int depth, const LabeledCube& a, const LabeledCube& b, int axis) {
    const Side from = side(depth, a, 2 * axis + 1), to = side(depth, b, 2 * axis);
    if (from.first == kNone || to.first == kNone) return;
    if (from.is_one && to.is_one && from.first == to.first) return;
    if (from.is_open) return join_all(depth, b, 2 * axis, from.first);
    if (to.is_open) return join_all(depth, a, 2 * axis + 1, to.first);
    if (depth == levels_.brick_depth()) return join_bricks(a, b, axis);
    if (const auto meeting = relations_.find(depth, a.row, b.row, axis)) {
      for (uint64_t rest = meeting->pairs; rest != 0; rest &= rest - 1) {
        const int pair = FaceRelations::lowest_pair(rest);
        unite(elements_[a.first + FaceRelations::of_low(pair)],
              elements_[b.first + FaceRelations::of_high(pair)]);
      }
      return;
    }
    const size_t used = elements_.size();
    for (int o = 0; o < kOctants; ++o) {
      if ((o & 4 >> axis) != 0) continue;
      const LabeledCube high = octant_of(out_, depth, a, o | 4 >> axis, kNone, elements_);
      const LabeledCube low = octant_of(out_, depth, b, o, kNone, elements_);
      join(depth + 1, high, low, axis);
      elements_.resize(used);
    }
  }

  struct Side {
    uint32_t first = kNone;  // set of the first component at the face; kNone: no component is there
    bool is_one = true;      // all components at the face are in this set
    bool is_open = false;    // all voxels at the face are empty
  };
  Side side(int depth, const LabeledCube& cube, int face) {
    if (!cube.exists) return {find(elements_[cube.first]), true, true};
    Side out;
    const uint8_t* const touch = out_.touch(depth, cube.row);
    const uint32_t count = out_.count(depth, cube.row);
    for (uint32_t c = 0; c < count; ++c) {
      if ((touch[c] >> face & 1) == 0) continue;
      const uint32_t root = find(elements_[cube.first + c]);
      if (out.first == kNone)
        out.first = root;
      else
        out.is_one &= root == out.first;
    }
    out.is_open = out_.open_faces(depth, cube.row) >> face & 1;
    return out;
  }

  void join_all(int depth, const LabeledCube& cube, int face, uint32_t with) {
    if (!cube.exists) return unite(elements_[cube.first], with);
    const uint8_t* const touch = out_.touch(depth, cube.row);
    const uint32_t count = out_.count(depth, cube.row);
    for (uint32_t c = 0; c < count; ++c)
      if ((touch[c] >> face & 1) != 0) unite(elements_[cube.first + c], with);
  }

  void join_bricks(const LabeledCube& a, const LabeledCube& b, int axis) {
    const uint64_t* const from = out_.brick_components(a.row);
    const uint64_t* const to = out_.brick_components(b.row);
    const uint32_t from_count = out_.count(levels_.brick_depth(), a.row);
    const uint32_t to_count = out_.count(levels_.brick_depth(), b.row);
    for (uint32_t i = 0; i < from_count; ++i) {
      const uint64_t high = (from[i] & brick_face(2 * axis + 1)) >> brick_face_shift(axis);
      for (uint32_t j = 0; j < to_count; ++j)
        if ((high & to[j]) != 0) unite(elements_[a.first + i], elements_[b.first + j]);
    }
  }

  uint32_t find(uint32_t element) {
    while (parents_[element] != element) element = parents_[element] = parents_[parents_[element]];
    return element;
  }
  // Joins two sets. The root with the lower number becomes the root of the joined set.
  void unite(uint32_t a, uint32_t b) {
    a = find(a);
    b = find(b);
    if (a < b)
      parents_[b] = a;
    else
      parents_[a] = b;
  }

  PooledMemory& memory_;
  const NodeLevels& levels_;
  SpaceLabels& out_;
  FaceRelations relations_;
  const CancelToken* cancel_ = nullptr;
  uint64_t touch_used_ = 0, maps_used_ = 0;
  // A number for each component: an index in parents_, or kNone. The components of the node's
  // octants are first and have the numbers 0, 1, .... While join() descends, the components of
  // smaller cubes follow. Each has the number of the octant's component that contains it, or kNone
  // if it is closed (space_labels.h) in its octant or in a smaller cube around it.
  std::vector<uint32_t> elements_;
  std::vector<uint32_t> parents_;  // union-find over the components of the octants
  std::vector<uint8_t> touch_;
  std::vector<uint32_t> labels_;
};

std::vector<uint8_t> connected_components(PooledMemory& memory, SpaceLabels& labels, int depth,
                                          uint32_t row, int octant, uint32_t component) {
  return SpaceLabeler(memory, labels).connected(depth, row, octant, component);
}

SpaceLabels::SpaceLabels(PooledMemory& memory, const NodeLevels& levels, const CancelToken* cancel)
    : levels_(levels) {
  SpaceLabeler(memory, *this).run(cancel);
}

}  // namespace voxdag
