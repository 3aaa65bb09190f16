// Rejects files whose nodes are not in the order by hash (docs/format.md, "Node order"). Commands
// that merge the levels of two files need this order.
#pragma once

#include <string>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/voxdag_reader.h"

namespace voxdag::query {

// Throws Error{kInvalidInput} unless the nodes of the file are in the order by hash. The message
// ends with the command that reorders the file, if the users have one.
inline void refuse_other_order(const voxdag_reader::File& file) {
  const NodeOrder order{file.node_order()};
  if (order == NodeOrder::kByHash) return;
  const std::string remedy = command_text("reorder", "order", "hash");
  throw Error(ErrorCode::kInvalidInput,
              file.path() + " has its nodes in the order " + name_of(order) +
                  ": expected the order hash" +
                  (remedy.empty() ? "" : ", which " + remedy + " writes"));
}

}  // namespace voxdag::query
