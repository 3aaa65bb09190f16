// Voxelization by work expansion (Sintorn, "DAG Construction", 2018). Level by level, every
// (triangle, cube) pair is replaced by pairs of the triangle and the cube's children that the
// triangle touches. There are three steps: count the children, scan the counts, emit the pairs.
//
// Each level has a frame, which is a buffer for a fixed number of pairs. The pairs of a frame are
// expanded in slices whose new pairs fit in the next frame. The new pairs are expanded completely
// before the next slice (depth first). So memory is bounded for any number of triangles.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/backend/backend.h"
#include "core/backend/parallel/space/space.h"
#include "core/backend/parallel/voxelize/crossed_voxels.h"
#include "core/backend/parallel/voxelize/triangle_cells.h"
#include "core/dag/brick.h"

namespace voxdag::parallel {

// Returns the position of the set bit that has `rank` set bits below it.
VOXDAG_HD inline int select_bit(uint64_t mask, uint32_t rank) {
  int at = 0;
  for (int width = 32; width > 0; width /= 2) {
    const uint64_t low_half = mask >> at & ((uint64_t{1} << width) - 1);
    const uint32_t below = static_cast<uint32_t>(popcount64(low_half));
    if (rank >= below) {
      rank -= below;
      at += width;
    }
  }
  return at;
}

// Computes the low corners of cubes in a subvolume. A cube has an edge of 2^shift lattice units.
// Its low corner is the subvolume's origin plus its decoded Morton code times 2^shift.
struct CubePlace {
  int64_t origin[3];

  explicit CubePlace(const SubvolumeTask& task) {
    const int64_t edge = task.cube.edge_voxels(task.grid_levels) * kUnitsPerVoxel;
    for (int a = 0; a < 3; ++a) origin[a] = task.cube.position[a] * edge;
  }
  VOXDAG_HD void low(uint64_t code, int shift, int64_t (&out)[3]) const {
    uint32_t k[3];
    morton_decode(code, k[0], k[1], k[2]);
    for (int a = 0; a < 3; ++a) out[a] = origin[a] + (static_cast<int64_t>(k[a]) << shift);
  }
};

// The count step: finds the parts of each pair's cube that the pair's triangle touches. The parts
// are the cube's children (N = 2) or, if the cube is a brick, its voxels (N = 4). With the rule
// kThin, the step finds the voxels that this rule sets.
template <int N, VoxelRule kRule>
struct CountParts {
  CubePlace place;
  int shift;  // log2 of a part's edge in lattice units
  const FixedTriangle* triangles;
  const uint64_t* codes;
  const uint32_t* pair_triangles;
  uint64_t* parts;
  uint32_t* counts;
  VOXDAG_HD void operator()(uint32_t i) const {
    int64_t low[3];
    place.low(codes[i], shift + (N == 2 ? 1 : 2), low);
    if constexpr (N == 4 && kRule == VoxelRule::kThin)
      parts[i] = crossed_voxels(triangles[pair_triangles[i]], low);
    else
      parts[i] = touched_cells<N>(triangles[pair_triangles[i]], low, shift);
    counts[i] = static_cast<uint32_t>(popcount64(parts[i]));
  }
};

// The emit step: makes a new pair for each part that CountParts found. `out_triangles` is null if
// only codes are needed.
struct EmitParts {
  int code_bits;  // 3 for children, 6 for voxels of a brick
  const uint64_t* codes;
  const uint32_t* pair_triangles;
  const uint64_t* parts;
  uint64_t* out_codes;
  uint32_t* out_triangles;
  VOXDAG_HD void operator()(uint32_t source, uint32_t rank, uint32_t output) const {
    out_codes[output] =
        codes[source] << code_bits | static_cast<uint64_t>(select_bit(parts[source], rank));
    if (out_triangles) out_triangles[output] = pair_triangles[source];
  }
};

// Makes the first pairs: every triangle with the cube of the complete subvolume.
struct StartPairs {
  uint32_t first_triangle;
  uint64_t* codes;
  uint32_t* pair_triangles;
  VOXDAG_HD void operator()(uint32_t i) const {
    codes[i] = 0;
    pair_triangles[i] = first_triangle + i;
  }
};

// Finds the longest slice of sources (see expand() in space.h), starting at `first`, that has at
// most `max_outputs` outputs. Writes the end of the slice and the number of its outputs to
// `answer`.
struct FindSlice {
  const uint32_t* offsets;
  uint32_t first, count, max_outputs;
  uint32_t* answer;  // two elements
  VOXDAG_HD void operator()(uint32_t) const {
    uint32_t last = first, end = count + 1;
    while (end - last > 1) {
      const uint32_t middle = last + (end - last) / 2;
      (offsets[middle] - offsets[first] <= max_outputs ? last : end) = middle;
    }
    answer[0] = last;
    answer[1] = offsets[last] - offsets[first];
  }
};

// Arrays with space for `capacity` pairs, to which the pairs of the last level are written.
struct PairSpan {
  uint64_t* codes;
  uint32_t* triangles;  // null if only codes are needed
  uint32_t capacity;
};

template <class Space>
class PairExpansion {
 public:
  // Pairs are expanded over `depths` levels below the subvolume. If `to_voxels` is set, the last of
  // these levels is the level of bricks, and one more step turns its pairs into voxels. `window`:
  // capacity of a frame in pairs, at least 64.
  PairExpansion(Space& space, const SubvolumeTask& task, int depths, bool to_voxels,
                uint32_t window)
      : space_(space),
        place_(task),
        top_shift_(static_cast<int>(task.grid_levels - task.cube.level) + kUnitBits),
        to_voxels_(to_voxels),
        rule_(task.rule),
        window_(window),
        slice_(space, 2) {
    for (int i = 0; i < depths + (to_voxels ? 1 : 0); ++i) frames_.emplace_back(space, window);
  }

  static constexpr uint64_t kBytesPerPair = sizeof(uint64_t) * 2 + sizeof(uint32_t) * 2;
  uint32_t window() const { return window_; }

  // Expands triangles [first, last) of `triangles`, at most window() of them. Writes the pairs of
  // the last level to out.span(), a PairSpan, and then reports their number with out.commit(n). If
  // the new pairs of one pair do not fit in the span, calls out.flush() to make space.
  template <class Out>
  void run(const FixedTriangle* triangles, uint32_t first, uint32_t last, Out& out) {
    triangles_ = triangles;
    Frame& top = frames_[0];
    space_.for_each(last - first, StartPairs{first, top.codes.data(), top.pair_triangles.data()});
    descend(0, last - first, out);
  }

 private:
  struct Frame {
    Frame(Space& space, uint32_t window)
        : codes(space, window),
          parts(space, window),
          pair_triangles(space, window),
          offsets(space, window + 1) {}
    SpaceArray<Space, uint64_t> codes, parts;
    SpaceArray<Space, uint32_t> pair_triangles, offsets;
  };
  struct Slice {
    uint32_t end, outputs;
  };

  bool is_last(size_t depth) const { return depth + 1 == frames_.size(); }
  bool makes_voxels(size_t depth) const { return to_voxels_ && is_last(depth); }

  template <int N, VoxelRule kRule = VoxelRule::kShell>
  void count_parts(Frame& f, int shift, uint32_t count) {
    space_.for_each(
        count, CountParts<N, kRule>{place_, shift, triangles_, f.codes.data(),
                                    f.pair_triangles.data(), f.parts.data(), f.offsets.data()});
  }

  template <class Out>
  void descend(size_t depth, uint32_t count, Out& out) {
    Frame& f = frames_[depth];
    const int shift = top_shift_ - static_cast<int>(depth);
    if (!makes_voxels(depth))
      count_parts<2>(f, shift - 1, count);
    else if (rule_ == VoxelRule::kThin)
      count_parts<4, VoxelRule::kThin>(f, shift - 2, count);
    else
      count_parts<4>(f, shift - 2, count);
    space_.scan(f.offsets.data(), count);
    for (uint32_t first = 0; first < count;) {
      const PairSpan to = is_last(depth) ? out.span() : next_frame(depth);
      const Slice slice = find_slice(f, first, count, to.capacity);
      if (slice.outputs > 0)
        space_.expand(f.offsets.data(), first, slice.end, slice.outputs,
                      EmitParts{makes_voxels(depth) ? 6 : 3, f.codes.data(),
                                f.pair_triangles.data(), f.parts.data(), to.codes, to.triangles});
      if (slice.end == first)
        out.flush();
      else if (is_last(depth))
        out.commit(slice.outputs);
      else if (slice.outputs > 0)
        descend(depth + 1, slice.outputs, out);
      first = slice.end;
    }
  }

  PairSpan next_frame(size_t depth) {
    Frame& next = frames_[depth + 1];
    return {next.codes.data(), next.pair_triangles.data(), window_};
  }

  Slice find_slice(Frame& f, uint32_t first, uint32_t count, uint32_t max_outputs) {
    space_.for_each(1, FindSlice{f.offsets.data(), first, count, max_outputs, slice_.data()});
    uint32_t answer[2];
    space_.download(slice_.data(), answer, 2);
    return {answer[0], answer[1]};
  }

  Space& space_;
  const CubePlace place_;
  const int top_shift_;  // log2 of the subvolume's edge in lattice units
  const bool to_voxels_;
  const VoxelRule rule_;
  const uint32_t window_;
  const FixedTriangle* triangles_ = nullptr;
  std::vector<Frame> frames_;
  SpaceArray<Space, uint32_t> slice_;
};

}  // namespace voxdag::parallel
