#include "query/components/cube_components.h"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "core/base/error.h"
#include "core/base/host_device.h"
#include "core/dag/brick.h"

namespace voxdag::query {
namespace {

constexpr uint32_t kNoLabel = ~uint32_t{0};

// Returns the axes of the coordinates u and v of a face.
constexpr int u_axis(int normal) { return normal == 0 ? 1 : 0; }
constexpr int v_axis(int normal) { return normal == 2 ? 1 : 2; }
constexpr uint32_t axis_bit(int child, int axis) {
  return static_cast<uint32_t>(child >> (2 - axis) & 1);
}

// The order in which components are listed: larger ones first, then by their boxes.
bool is_before(const Component& a, const Component& b) {
  if (a.voxels != b.voxels) return a.voxels > b.voxels;
  return std::tie(a.low, a.high) < std::tie(b.low, b.high);
}

// Call keep_largest() after the last component was added.
void add_closed(CubeComponents& cube, const Component& component) {
  ++cube.closed;
  cube.largest.push_back(component);
}

// Sorts the closed components that were added, and keeps the largest ones.
void keep_largest(CubeComponents& cube, const ComponentRule& rule) {
  std::vector<Component>& all = cube.largest;
  if (all.size() > rule.largest) {
    std::ranges::nth_element(all, all.begin() + static_cast<std::ptrdiff_t>(rule.largest),
                             is_before);
    all.resize(rule.largest);
  }
  std::ranges::sort(all, is_before);
  all.shrink_to_fit();
}

Component moved(Component component, const std::array<uint32_t, 3>& offset) {
  for (size_t axis = 0; axis < 3; ++axis) {
    component.low[axis] += offset[axis];
    component.high[axis] += offset[axis];
  }
  return component;
}

void unite(Component& to, const Component& from) {
  to.voxels += from.voxels;
  for (size_t axis = 0; axis < 3; ++axis) {
    to.low[axis] = std::min(to.low[axis], from.low[axis]);
    to.high[axis] = std::max(to.high[axis], from.high[axis]);
  }
}

// Sets of labels. The first label of a set names it, so the names do not depend on the order in
// which sets are united.
class LabelSets {
 public:
  explicit LabelSets(size_t labels) : parents_(labels) {
    std::iota(parents_.begin(), parents_.end(), 0);
  }
  uint32_t find(uint32_t label) {
    while (parents_[label] != label) label = parents_[label] = parents_[parents_[label]];
    return label;
  }
  void unite(uint32_t a, uint32_t b) {
    a = find(a);
    b = find(b);
    if (a != b) parents_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<uint32_t> parents_;
};

// Unites the components of two planes of voxels with a common plane between them. `reach` is 0 if
// voxels are connected by faces, and 1 if they are also connected by edges and corners.
void unite_planes(const std::vector<FaceRun>& low, const std::vector<FaceRun>& high, uint32_t reach,
                  LabelSets& sets) {
  for (int64_t shift = -int64_t{reach}; shift <= int64_t{reach}; ++shift) {
    size_t next = 0;
    for (const FaceRun& run : low) {
      const int64_t row = run.u + shift;
      // Skips the runs that end before this run and all later ones.
      while (next < high.size() &&
             (high[next].u < row || (high[next].u == row && high[next].end + reach <= run.begin)))
        ++next;
      for (size_t i = next; i < high.size() && high[i].u == row && high[i].begin < run.end + reach;
           ++i)
        sets.unite(run.label, high[i].label);
    }
  }
}

// Appends a run. Extends the last run instead if the new run continues it.
void append(std::vector<FaceRun>& runs, const FaceRun& run) {
  if (!runs.empty()) {
    FaceRun& last = runs.back();
    if (last.u == run.u && last.end == run.begin && last.label == run.label) {
      last.end = run.end;
      return;
    }
  }
  runs.push_back(run);
}

class CubeJoin {
 public:
  CubeJoin(std::span<const CubeComponents* const, 8> children, uint32_t edge)
      : children_(children), edge_(edge), sets_(number_labels()) {}

  CubeComponents run(const ComponentRule& rule) {
    const uint32_t reach = rule.connectivity == Connectivity::kCorners ? 1 : 0;
    const auto own = [](uint32_t label) { return label; };
    for (int axis = 0; axis < 3; ++axis)
      unite_planes(plane(axis, 0, 1, own), plane(axis, 1, 0, own), reach, sets_);
    CubeComponents joined;
    std::vector<uint32_t> labels(label_count_, kNoLabel);  // labels in `joined`, by set
    uint32_t open = 0;
    const auto open_label = [&](uint32_t label) {
      uint32_t& opened = labels[sets_.find(label)];
      if (opened == kNoLabel) opened = open++;
      return opened;
    };
    for (int axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 2; ++side)
        joined.faces[static_cast<size_t>(2 * axis + side)] = plane(axis, side, side, open_label);
    joined.open.resize(open);
    add_components(labels, joined, rule);
    return joined;
  }

 private:
  std::array<uint32_t, 3> offset_of(int child) const {
    return {edge_ * axis_bit(child, 0), edge_ * axis_bit(child, 1), edge_ * axis_bit(child, 2)};
  }
  // Numbers the open components of all children. Returns their number.
  size_t number_labels() {
    for (size_t child = 0; child < 8; ++child) {
      first_label_[child] = static_cast<uint32_t>(label_count_);
      if (children_[child]) label_count_ += children_[child]->open.size();
    }
    if (label_count_ >= kNoLabel)
      throw Error(ErrorCode::kLimit, "the faces of cubes of " +
                                         std::to_string(2 * uint64_t{edge_}) +
                                         " voxels per edge touch " + std::to_string(label_count_) +
                                         " components: expected less than 2^32");
    return label_count_;
  }
  // Returns the runs of the faces `side` (0 or 1) of the four children in the half `half` (0 or 1)
  // of the cube on `axis`. Converts labels with label_of(), whose argument is a number of
  // number_labels().
  template <class LabelOf>
  std::vector<FaceRun> plane(int axis, int half, int side, const LabelOf& label_of) const {
    std::vector<FaceRun> runs;
    for (int u = 0; u < 2; ++u) {
      const int first = half << (2 - axis) | u << (2 - u_axis(axis));
      const int second = first | 1 << (2 - v_axis(axis));
      const auto face = static_cast<size_t>(2 * axis + side);
      size_t next[2] = {};
      const int sources[2] = {first, second};
      const auto row_of = [&](int i) {
        const CubeComponents* const cube = children_[static_cast<size_t>(sources[i])];
        return cube && next[i] < cube->faces[face].size() ? cube->faces[face][next[i]].u : kNoRow;
      };
      // Each row begins with the runs of the first child.
      for (;;) {
        const uint32_t row = std::min(row_of(0), row_of(1));
        if (row == kNoRow) break;
        for (int i = 0; i < 2; ++i)
          for (; row_of(i) == row; ++next[i]) {
            const auto child = static_cast<size_t>(sources[i]);
            const FaceRun& run = children_[child]->faces[face][next[i]];
            const uint32_t v = i == 0 ? 0 : edge_;
            append(runs, {run.u + (u == 0 ? 0 : edge_), run.begin + v, run.end + v,
                          label_of(first_label_[child] + run.label)});
          }
      }
    }
    return runs;
  }
  // Adds the components of all children to `joined`. `labels` has the labels of its open
  // components.
  void add_components(const std::vector<uint32_t>& labels, CubeComponents& joined,
                      const ComponentRule& rule) {
    std::vector<Component> closed(label_count_);
    for (int child = 0; child < 8; ++child) {
      const CubeComponents* const cube = children_[static_cast<size_t>(child)];
      if (!cube) continue;
      for (uint32_t i = 0; i < cube->open.size(); ++i) {
        const uint32_t set = sets_.find(first_label_[static_cast<size_t>(child)] + i);
        unite(labels[set] == kNoLabel ? closed[set] : joined.open[labels[set]],
              moved(cube->open[i], offset_of(child)));
      }
      joined.closed += cube->closed - cube->largest.size();
      for (const Component& component : cube->largest)
        add_closed(joined, moved(component, offset_of(child)));
    }
    for (const Component& component : closed)
      if (component.voxels > 0) add_closed(joined, component);
    keep_largest(joined, rule);
  }

  static constexpr uint32_t kNoRow = ~uint32_t{0};

  const std::span<const CubeComponents* const, 8> children_;
  const uint32_t edge_;
  size_t label_count_ = 0;
  std::array<uint32_t, 8> first_label_ = {};
  LabelSets sets_;
};

// Returns the voxels of a brick that are in the component of the voxels `seed`.
uint64_t grown(uint64_t mask, uint64_t seed, uint32_t reach) {
  const auto voxel = [](int bit, int axis) { return brick_coordinate(bit, axis); };
  for (;;) {
    uint64_t next = seed;
    for (uint64_t left = seed; left != 0; left &= left - 1) {
      const int bit = std::countr_zero(left);
      for (int dx = -1; dx <= 1; ++dx)
        for (int dy = -1; dy <= 1; ++dy)
          for (int dz = -1; dz <= 1; ++dz) {
            const int x = voxel(bit, 0) + dx, y = voxel(bit, 1) + dy, z = voxel(bit, 2) + dz;
            if (reach == 0 && dx * dx + dy * dy + dz * dz > 1) continue;
            if (((x | y | z) & ~3) == 0) next |= uint64_t{1} << brick_bit(x, y, z);
          }
    }
    next &= mask;
    if (next == seed) return seed;
    seed = next;
  }
}

}  // namespace

uint64_t CubeComponents::bytes() const {
  uint64_t bytes = sizeof(CubeComponents);
  for (const auto& face : faces) bytes += face.capacity() * sizeof(FaceRun);
  return bytes + (open.capacity() + largest.capacity()) * sizeof(Component);
}

CubeComponents components_of_brick(uint64_t mask, const ComponentRule& rule) {
  const uint32_t reach = rule.connectivity == Connectivity::kCorners ? 1 : 0;
  CubeComponents cube;
  std::array<uint32_t, 64> labels;
  labels.fill(kNoLabel);
  for (uint64_t left = mask; left != 0;) {
    const uint64_t voxels = grown(mask, left & -left, reach);
    left &= ~voxels;
    Component component;
    bool is_open = false;
    for (int bit = 0; bit < 64; ++bit) {
      if (!(voxels >> bit & 1)) continue;
      Component voxel{1, {}, {}};
      for (int axis = 0; axis < 3; ++axis) {
        const auto at = static_cast<uint32_t>(brick_coordinate(bit, axis));
        voxel.low[static_cast<size_t>(axis)] = at;
        voxel.high[static_cast<size_t>(axis)] = at + 1;
        is_open = is_open || at == 0 || at == kBrickEdge - 1;
      }
      unite(component, voxel);
      labels[static_cast<size_t>(bit)] = static_cast<uint32_t>(cube.open.size());
    }
    if (is_open)
      cube.open.push_back(component);
    else
      add_closed(cube, component);
  }
  keep_largest(cube, rule);
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 2; ++side)
      for (uint32_t u = 0; u < kBrickEdge; ++u)
        for (uint32_t v = 0; v < kBrickEdge; ++v) {
          std::array<int, 3> at;
          at[static_cast<size_t>(axis)] = side * (kBrickEdge - 1);
          at[static_cast<size_t>(u_axis(axis))] = static_cast<int>(u);
          at[static_cast<size_t>(v_axis(axis))] = static_cast<int>(v);
          const uint32_t label = labels[static_cast<size_t>(brick_bit(at[0], at[1], at[2]))];
          if (label != kNoLabel)
            append(cube.faces[static_cast<size_t>(2 * axis + side)], {u, v, v + 1, label});
        }
  return cube;
}

CubeComponents join_components(std::span<const CubeComponents* const, 8> children, uint32_t edge,
                               const ComponentRule& rule) {
  return CubeJoin(children, edge).run(rule);
}

void close_all(CubeComponents& cube, const ComponentRule& rule) {
  for (const Component& component : cube.open) add_closed(cube, component);
  keep_largest(cube, rule);
  cube.open.clear();
  for (auto& face : cube.faces) face.clear();
}

}  // namespace voxdag::query
