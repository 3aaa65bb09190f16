// A DAG's level arrays on the host. All arrays are copied before the first call of the sink,
// because the sink must not be called for a subvolume that does not fit in the budget.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/backend/parallel/dag/dag.h"
#include "core/base/error.h"
#include "core/base/page_buffer.h"
#include "core/dag/sub_dag.h"

namespace voxdag::parallel {

// An array of a space (space.h) on the host. For a HostSpace, this is the array itself, otherwise a
// copy.
template <class Space, class T>
class HostArray {
 public:
  HostArray() = default;
  HostArray(Space& space, SpaceArray<Space, T>&& array) {
    const uint64_t size = array.size();
    if constexpr (Space::kOnHost) {
      array_ = std::move(array);
      view_ = {array_.data(), size};
    } else {
      copy_ = pages(space.budget(), size);
      space.download(array.data(), copy_.data(), size);
      array = {};
      view_ = {copy_.data(), size};
    }
  }
  std::span<const T> view() const { return view_; }

 private:
  static PageBuffer<T> pages(MemoryBudget& budget, uint64_t size) {
    try {
      return PageBuffer<T>(budget, size, "level arrays");
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kOutOfMemory) throw OutOfBudget{};
      throw;
    }
  }

  SpaceArray<Space, T> array_;
  PageBuffer<T> copy_;
  std::span<const T> view_;
};

template <class Space>
class HostLevels {
 public:
  HostLevels(Space& space, SpaceDag<Space>&& dag)
      : brick_masks_(space, std::move(dag.bricks.masks)) {
    for (DagLevel<Space>& level : dag.levels)
      levels_.push_back({{space, std::move(level.hashes)},
                         {space, std::move(level.masks)},
                         {space, std::move(level.children)}});
  }

  void send(uint32_t brick_level, SubDagSink& sink) const {
    sink.bricks(BrickLevelView{brick_masks_.view()});
    uint32_t level = brick_level;
    for (const Nodes& nodes : levels_)
      sink.nodes(
          NodeLevelView{--level, nodes.hashes.view(), nodes.masks.view(), nodes.children.view()});
  }

 private:
  struct Nodes {
    HostArray<Space, uint64_t> hashes;
    HostArray<Space, uint8_t> masks;
    HostArray<Space, uint32_t> children;
  };
  HostArray<Space, uint64_t> brick_masks_;
  std::vector<Nodes> levels_;
};

}  // namespace voxdag::parallel
