#include "core/backend/cpu/memo/full_nodes.h"

#include <algorithm>
#include <iterator>

namespace voxdag::cpu {

NodeRef FullNodes::make(int size_log2) {
  NodeRef children[8];
  if (size_log2 > kBrickLevels)
    std::fill(std::begin(children), std::end(children), node(size_log2 - 1));
  const OctreeCounts before = tables_.counts();
  const NodeRef full = size_log2 == kBrickLevels ? tables_.add_brick(~uint64_t{0})
                                                 : tables_.add_node(size_log2, children);
  tables_.counts() = before;
  return full;
}

}  // namespace voxdag::cpu
