#include "scheduler/stages/enclose/join_parts.h"

#include <utility>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/dag/space/face_code.h"
#include "scheduler/stages/enclose/part_tree.h"

namespace voxdag {
namespace {

// Returns a mask of the faces of a cube that are on the border of the grid.
uint8_t border_faces(const Cube& cube) {
  uint8_t faces = 0;
  for (int a = 0; a < 3; ++a) {
    if (cube.position[a] == 0) faces = static_cast<uint8_t>(faces | 1 << 2 * a);
    if (cube.position[a] + 1 == uint32_t{1} << cube.level)
      faces = static_cast<uint8_t>(faces | 2 << 2 * a);
  }
  return faces;
}

std::vector<Cube> cubes_of(const std::vector<LabeledPart>& parts) {
  std::vector<Cube> cubes;
  for (const LabeledPart& part : parts) cubes.push_back(part.cube);
  return cubes;
}

// Sets of components (union-find). A set reaches the border, or has the seed, if one of its
// components does.
class ComponentSets {
 public:
  ComponentSets(MemoryBudget& budget, uint64_t count)
      : charge_(budget, count * (sizeof(uint32_t) + 1), "the components of the empty space"),
        parents_(count),
        marks_(count, 0) {
    for (uint64_t i = 0; i < count; ++i) parents_[i] = static_cast<uint32_t>(i);
  }
  enum Mark : uint8_t { kBorder = 1, kSeed = 2 };

  void mark(uint32_t component, Mark mark) { marks_[find(component)] |= mark; }
  bool has(uint32_t component, Mark mark) { return (marks_[find(component)] & mark) != 0; }
  void unite(uint32_t a, uint32_t b) {
    a = find(a);
    b = find(b);
    if (a == b) return;
    if (b < a) std::swap(a, b);
    parents_[b] = a;
    marks_[a] |= marks_[b];
  }

 private:
  uint32_t find(uint32_t i) {
    while (parents_[i] != i) i = parents_[i] = parents_[parents_[i]];
    return i;
  }

  const MemoryCharge charge_;
  std::vector<uint32_t> parents_;
  std::vector<uint8_t> marks_;
};

class PartJoiner {
 public:
  PartJoiner(const std::vector<LabeledPart>& parts, const RowFile& faces,
             const std::optional<Seed>& seed, uint32_t grid_levels, MemoryBudget& budget,
             const CancelToken& cancel)
      : parts_(parts),
        faces_(faces),
        seed_(seed),
        grid_levels_(grid_levels),
        budget_(budget),
        cancel_(cancel),
        tree_(cubes_of(parts)),
        tree_charge_(budget, tree_.bytes() + tree_.leaves().size() * sizeof(uint32_t),
                     "the cubes of the grid"),
        sets_(budget, number_components()) {}

  OutsideSpace run() {
    mark_border();
    const std::optional<uint32_t> of_seed = mark_seed();
    join_inside(tree_.root());
    OutsideSpace out;
    out.is_seed_outside = of_seed && sets_.has(*of_seed, ComponentSets::kBorder);
    out.of_parts.resize(parts_.size());
    for (size_t i = 0; i < tree_.leaves().size(); ++i) add_outside(i, out);
    return out;
  }

 private:
  // Numbers the components of all leaves consecutively. Stores each leaf's first number in first_,
  // and returns the number of components.
  uint64_t number_components() {
    uint64_t count = 0;
    for (const PartTree::Leaf& leaf : tree_.leaves()) {
      first_.push_back(static_cast<uint32_t>(count));
      count += leaf.part == PartTree::kEmpty ? 1 : parts_[leaf.part].touch.size();
    }
    if (count >= UINT32_MAX)
      throw Error(ErrorCode::kLimit, "the empty space has " + std::to_string(count) +
                                         " components at the faces of subvolumes: expected fewer "
                                         "than 2^32");
    return count;
  }

  void mark_border() {
    for (size_t i = 0; i < tree_.leaves().size(); ++i) {
      const PartTree::Leaf& leaf = tree_.leaves()[i];
      const uint8_t border = border_faces(leaf.cube);
      if (leaf.part == PartTree::kEmpty) {
        if (border != 0) sets_.mark(first_[i], ComponentSets::kBorder);
        continue;
      }
      const std::vector<uint8_t>& touch = parts_[leaf.part].touch;
      for (size_t c = 0; c < touch.size(); ++c)
        if ((touch[c] & border) != 0)
          sets_.mark(first_[i] + static_cast<uint32_t>(c), ComponentSets::kBorder);
    }
  }

  // Marks the component with the seed and returns it. Returns nullopt if there is no seed, or if
  // the seed's component reaches no face of its part.
  std::optional<uint32_t> mark_seed() {
    for (size_t i = 0; i < tree_.leaves().size(); ++i) {
      const PartTree::Leaf& leaf = tree_.leaves()[i];
      if (!seed_in(seed_, leaf.cube, grid_levels_)) continue;
      uint32_t component = first_[i];
      if (leaf.part != PartTree::kEmpty) {
        const std::optional<uint32_t> in_part = parts_[leaf.part].seed_component;
        if (!in_part) return std::nullopt;
        component += *in_part;
      }
      sets_.mark(component, ComponentSets::kSeed);
      return component;
    }
    return std::nullopt;
  }

  bool is_outside(uint32_t component) {
    return sets_.has(component, ComponentSets::kBorder) ||
           (seed_ && !sets_.has(component, ComponentSets::kSeed));
  }

  void add_outside(size_t leaf_index, OutsideSpace& out) {
    const PartTree::Leaf& leaf = tree_.leaves()[leaf_index];
    const uint32_t first = first_[leaf_index];
    if (leaf.part == PartTree::kEmpty) {
      if (!is_outside(first)) out.enclosed_cubes.push_back(leaf.cube);
      return;
    }
    const size_t count = parts_[leaf.part].touch.size();
    for (size_t c = 0; c < count; ++c)
      out.of_parts[leaf.part].push_back(is_outside(first + static_cast<uint32_t>(c)) ? 1 : 0);
  }

  // A cube of the tree or, if `path` is not empty, a part of a leaf's face: a quadrant, a quadrant
  // of this quadrant, and so on, as `path` selects them.
  struct Place {
    PartTree::Ref ref;
    std::vector<uint8_t> path;
  };

  void join_inside(PartTree::Ref ref) {
    if (ref.is_leaf) return;
    for (int o = 0; o < 8; ++o) join_inside(tree_.child(ref, o));
    for (int axis = 0; axis < 3; ++axis)
      for (int o = 0; o < 8; ++o)
        if ((o & 4 >> axis) == 0)
          join({tree_.child(ref, o), {}}, {tree_.child(ref, o | 4 >> axis), {}}, axis);
  }

  // Joins the components of two neighbors where they meet. `a` is below `b` along the axis.
  void join(const Place& a, const Place& b, int axis) {
    if (a.ref.is_leaf && b.ref.is_leaf) return join_leaves(a, b, axis);
    uint8_t quadrant = 0;
    for (int o = 0; o < 8; ++o)
      if ((o & 4 >> axis) == 0) {
        join(quadrant_of(a, o | 4 >> axis, quadrant), quadrant_of(b, o, quadrant), axis);
        ++quadrant;
      }
  }
  Place quadrant_of(const Place& place, int octant, uint8_t quadrant) const {
    if (!place.ref.is_leaf) return {tree_.child(place.ref, octant), {}};
    Place out = place;
    out.path.push_back(quadrant);
    return out;
  }

  void join_leaves(const Place& a, const Place& b, int axis) {
    cancel_.check();
    read(a.ref.index, 2 * axis + 1, low_);
    read(b.ref.index, 2 * axis, high_);
    FaceReader in_a(faces_.path(), low_.bytes), in_b(faces_.path(), high_.bytes);
    const auto square_a = in_a.descend(a.path), square_b = in_b.descend(b.path);
    const uint32_t first_a = first_[a.ref.index], first_b = first_[b.ref.index];
    join_squares(in_a, square_a, in_b, square_b, [&](uint32_t label_a, uint32_t label_b) {
      check_label(a.ref.index, label_a);
      check_label(b.ref.index, label_b);
      sets_.unite(first_a + label_a, first_b + label_b);
    });
  }

  void check_label(uint32_t leaf, uint32_t label) const {
    const uint32_t part = tree_.leaves()[leaf].part;
    const size_t components = part == PartTree::kEmpty ? 1 : parts_[part].touch.size();
    if (label < components) return;
    throw Error(ErrorCode::kCorrupt,
                faces_.path() +
                    ": the labels of the empty space at a face of a subvolume are damaged: label " +
                    std::to_string(label) +
                    " is not the number of a component, expected less than " +
                    std::to_string(components) + "; start over with " + option_text("restart"));
  }

  // The face quadtree that was read last. It is kept because a large cube has many small neighbors
  // at the same face.
  struct LoadedFace {
    uint32_t leaf = UINT32_MAX;
    int face = 0;
    std::vector<std::byte> bytes;
    MemoryCharge charge;
  };
  void read(uint32_t leaf, int face, LoadedFace& loaded) {
    if (loaded.leaf == leaf && loaded.face == face) return;
    const uint32_t part = tree_.leaves()[leaf].part;
    loaded.bytes.clear();
    if (part == PartTree::kEmpty) {
      loaded.bytes = empty_face();
    } else {
      const RowExtent& extent = parts_[part].faces[face];
      loaded.charge = {};
      loaded.charge = MemoryCharge(budget_, extent.bytes, "the labels of a face");
      loaded.bytes = faces_.read(extent);
    }
    loaded.leaf = leaf;
    loaded.face = face;
  }

  const std::vector<LabeledPart>& parts_;
  const RowFile& faces_;
  const std::optional<Seed>& seed_;
  const uint32_t grid_levels_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  const PartTree tree_;
  const MemoryCharge tree_charge_;
  std::vector<uint32_t> first_;  // by leaf: the number of its first component
  ComponentSets sets_;
  LoadedFace low_, high_;
};

}  // namespace

OutsideSpace find_outside(const std::vector<LabeledPart>& parts, const RowFile& faces,
                          const std::optional<Seed>& seed, uint32_t grid_levels,
                          MemoryBudget& budget, const CancelToken& cancel) {
  return PartJoiner(parts, faces, seed, grid_levels, budget, cancel).run();
}

}  // namespace voxdag
