#include "query/dag/dag_view.h"

#include <string>

#include "core/base/error.h"

namespace voxdag::query {

void refuse_missing_node(const std::string& path, uint32_t level, uint64_t offset) {
  throw Error(ErrorCode::kCorrupt, path + ": level " + std::to_string(level) + ", word " +
                                       std::to_string(offset) +
                                       ": no node begins here, although a parent points here");
}

DagView::DagView(const voxdag_reader::File& file)
    : grid_levels_(file.grid_levels()), path_(file.path()) {
  if (file.empty()) return;
  for (uint32_t l = 0; l <= file.brick_level(); ++l)
    levels_.push_back({{file.level(l).words, static_cast<size_t>(file.level(l).word_count)},
                       file.level(l).pointer_bits == 64});
}

}  // namespace voxdag::query
