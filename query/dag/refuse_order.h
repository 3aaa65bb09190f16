// Refuses files whose nodes are not in the order by hash, for commands that merge sorted levels.
#pragma once

#include <string>

#include "core/base/error.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/voxdag_reader.h"

namespace voxdag::query {

// Throws Error{kInvalidInput} unless the nodes are in the order by hash. The message ends with the
// command that changes the order.
inline void refuse_other_order(const voxdag_reader::File& file) {
  if (NodeOrder{file.node_order()} != NodeOrder::kByHash)
    throw Error(ErrorCode::kInvalidInput,
                file.path() + " has its nodes in the order " +
                    name_of(NodeOrder{file.node_order()}) +
                    ": expected the order hash, which voxdag reorder --order hash writes");
}

}  // namespace voxdag::query
