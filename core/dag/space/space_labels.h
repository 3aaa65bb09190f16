// Labels the empty space of a sub-DAG. In the cube of each node, it labels the 6-connected
// components of empty voxels that have a voxel at a face of the cube. All other components are
// *closed*: no walk through empty voxels leads out of them, whatever is around the cube.
//
// Components belong to a node and not to its places in the octree. So the cost depends on the
// number of unique nodes. The components of a node follow from the components of its octants, which
// are joined where they meet: level by level, from the bricks upwards.
//
//   labels of a node    0, 1, ...: its components in the order in which a walk over the components
//                       of its octants first meets them
//   labels of a brick   its components in the order of their lowest voxels at a face
//
// An octant without a node is empty and has one component. Immutable after construction.
#pragma once

#include <cstdint>
#include <vector>

#include "core/dag/space/brick_space.h"
#include "core/dag/space/node_levels.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

class SpaceLabels {
 public:
  static constexpr uint16_t kClosed = 0xffff;

  // `levels` must outlive this object. Throws OutOfBudget if the memory is too small, or if a node
  // has too many components for 16 bits. Neither happens for a cube with the edge kSmallestEdge and
  // a budget of kSmallestBudget (core/backend/backend.h). If `cancel` is not null, also throws
  // Error{kCanceled} after a cancellation.
  SpaceLabels(PooledMemory& memory, const NodeLevels& levels, const CancelToken* cancel = nullptr);

  const NodeLevels& levels() const { return levels_; }
  // Returns the number of components of a node or brick.
  uint32_t count(int depth, uint32_t row) const {
    const Row& r = at(depth).rows[row];
    return r.count < Row::kMany ? r.count : (&r)[1].first - r.first;
  }
  // Returns, for each component, the faces of the cube at which it has a voxel.
  const uint8_t* touch(int depth, uint32_t row) const {
    const Depth& d = at(depth);
    const Row& r = d.rows[row];
    return r.count <= Row::kFew ? r.touch : d.touch.data() + r.first;
  }
  // Returns the faces of the cube at which all voxels are empty.
  uint8_t open_faces(int depth, uint32_t row) const { return at(depth).rows[row].open; }
  // Returns, for each component of an octant, its label in the node, or kClosed.
  const uint16_t* labels_of_octant(int depth, uint32_t row, int octant) const {
    const Depth& d = at(depth);
    const uint16_t* const map = d.maps.data() + d.first_map[row];
    return map + map[octant];
  }
  // Returns, for each component of a brick, the mask of its voxels.
  const uint64_t* brick_components(uint32_t row) const {
    return brick_masks_.data() + at(levels_.brick_depth()).rows[row].first;
  }

 private:
  friend class SpaceLabeler;

  // The components of a node. If there are at most kFew, as in most nodes, `touch` has their faces,
  // so that one memory access is enough.
  struct Row {
    static constexpr uint8_t kFew = 2, kMany = 255;

    uint32_t first = 0;  // index in Depth::touch
    uint8_t count = 0;   // kMany: the next row's `first` minus this row's is the count
    uint8_t open = 0;    // faces at which all voxels are empty
    uint8_t touch[kFew] = {};
  };
  struct Depth {
    PooledArray<Row> rows;  // one row more than the depth has nodes
    PooledArray<uint8_t> touch;
    // For each row, an index in `maps`. From this index on, `maps` has the start of each octant's
    // labels (relative to this index), and then the labels.
    PooledArray<uint32_t> first_map;
    PooledArray<uint16_t> maps;
  };
  const Depth& at(int depth) const { return depths_[static_cast<size_t>(depth)]; }

  const NodeLevels& levels_;
  std::vector<Depth> depths_;
  PooledArray<uint64_t> brick_masks_;
};

// Returns an element for each component of a node's octants, in the order of the octants: 1 if the
// component is connected, within the node, with component `component` of octant `octant`, otherwise
// 0. Throws OutOfBudget.
std::vector<uint8_t> connected_components(PooledMemory& memory, SpaceLabels& labels, int depth,
                                          uint32_t row, int octant, uint32_t component);

// A node, a brick or an empty cube at one place of the octree. The caller numbers its components.
struct LabeledCube {
  bool exists = false;  // false: the cube is empty
  uint32_t row = 0;
  size_t first = 0;  // index, in the caller's list, of the number of its first component
};

// Returns octant `octant` of a cube. Appends the numbers of the octant's components to `numbers`,
// which has the numbers of the cube's components; closed components get the number `closed`.
inline LabeledCube octant_of(const SpaceLabels& labels, int depth, const LabeledCube& cube,
                             int octant, uint32_t closed, std::vector<uint32_t>& numbers) {
  const NodeLevels& levels = labels.levels();
  LabeledCube out{levels.has_child(depth, cube.row, octant), 0, numbers.size()};
  if (out.exists) out.row = levels.child(depth, cube.row, octant);
  const uint32_t count = out.exists ? labels.count(depth + 1, out.row) : 1;
  const uint16_t* const of_octant = labels.labels_of_octant(depth, cube.row, octant);
  numbers.resize(out.first + count);
  const uint32_t* const of_cube = numbers.data() + cube.first;
  uint32_t* const appended = numbers.data() + out.first;
  for (uint32_t c = 0; c < count; ++c)
    appended[c] = of_octant[c] == SpaceLabels::kClosed ? closed : of_cube[of_octant[c]];
  return out;
}

}  // namespace voxdag
