// A DAG's level arrays on the host. All arrays are copied before the first call of the sink,
// because the sink must not be called for a subvolume that does not fit in the budget.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/backend/parallel/dag/dag.h"
#include "core/base/error.h"
#include "core/base/page_buffer.h"
#include "core/dag/sub_dag.h"

namespace voxdag::parallel {

// The arrays of a HostSpace are on the host already. The arrays of another space are copied to one
// area of host memory, which is the space's download area or, if they do not fit there, a
// PageBuffer. The download area is valid until the space's device is used for the next build.
template <class Space>
class HostLevels {
 public:
  HostLevels(Space& space, SpaceDag<Space>&& dag) {
    if constexpr (Space::kOnHost) {
      dag_ = std::move(dag);
      view(dag_, [](const auto& array) { return std::span(array.data(), array.size()); });
    } else {
      uint64_t bytes = 0;
      view(dag, [&](const auto& array) {
        bytes += bytes_of(array);
        return std::span(array.data(), 0);
      });
      std::byte* next = space.download_area(bytes);
      if (next == nullptr && bytes > 0) {
        pages_ = pages(space.budget(), bytes);
        next = pages_.data();
      }
      view(dag, [&]<class T>(const SpaceArray<Space, T>& array) {
        T* const to = reinterpret_cast<T*>(next);
        next += bytes_of(array);
        space.begin_download(array.data(), to, array.size());
        return std::span<const T>(to, array.size());
      });
      space.finish_downloads();
    }
  }

  void send(uint32_t brick_level, SubDagSink& sink) const {
    sink.bricks(BrickLevelView{brick_masks_});
    uint32_t level = brick_level;
    for (const Nodes& nodes : levels_)
      sink.nodes(NodeLevelView{--level, nodes.hashes, nodes.masks, nodes.children});
  }

 private:
  struct Nodes {
    std::span<const uint64_t> hashes;
    std::span<const uint8_t> masks;
    std::span<const uint32_t> children;
  };

  // Returns the bytes of an array in the area, rounded up so that the next array is aligned.
  template <class T>
  static uint64_t bytes_of(const SpaceArray<Space, T>& array) {
    return (array.size() * sizeof(T) + 7) / 8 * 8;
  }
  static PageBuffer<std::byte> pages(MemoryBudget& budget, uint64_t size) {
    try {
      return PageBuffer<std::byte>(budget, size, "level arrays");
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kOutOfMemory) throw OutOfBudget{};
      throw;
    }
  }
  // Sets the spans to view_of(array) for each array of `dag`.
  template <class ViewOf>
  void view(const SpaceDag<Space>& dag, ViewOf view_of) {
    brick_masks_ = view_of(dag.bricks.masks);
    levels_.clear();
    for (const DagLevel<Space>& level : dag.levels)
      levels_.push_back({view_of(level.hashes), view_of(level.masks), view_of(level.children)});
  }

  SpaceDag<Space> dag_;  // only for a HostSpace
  PageBuffer<std::byte> pages_;
  std::span<const uint64_t> brick_masks_;
  std::vector<Nodes> levels_;  // from the bricks' parents up to the root
};

}  // namespace voxdag::parallel
