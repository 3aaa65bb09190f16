#include "query/dag/dag_input.h"

#include <string>

#include "core/base/error.h"
#include "core/base/process_limits.h"

namespace voxdag::query {

void DagInput::check() {
  touched_bytes_ = 0;
  cancel_.check();
  if (resident_bytes() > memory_bytes_) file_.release_pages();
}

void DagInput::corrupt(uint32_t level, uint64_t offset, const char* what) const {
  throw Error(ErrorCode::kCorrupt, file_.path() + ": level " + std::to_string(level) + ", word " +
                                       std::to_string(offset) + ": " + what);
}

void LevelCursor::check_chunk() {
  const uint64_t end = std::min(checked_ + kChunkWords, words_.word_count);
  if (checked_ == end) return;
  input_.blocks_.expect_intact(words_.words + checked_, sizeof(uint32_t) * (end - checked_));
  input_.touch(sizeof(uint32_t) * (end - checked_));
  checked_ = end;
}

void LevelCursor::expect_all_nodes() const {
  if (offset_ == words_.word_count && count_ == words_.node_count) return;
  throw Error(ErrorCode::kCorrupt, input_.file_.path() + ": level " + std::to_string(level_) +
                                       ": its words hold " + std::to_string(count_) +
                                       " nodes, expected " + std::to_string(words_.node_count));
}

}  // namespace voxdag::query
