#include "query/reorder/order_levels.h"

#include <algorithm>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "query/reorder/by_hash.h"
#include "query/reorder/first_parent.h"

namespace voxdag::query {
namespace {

// Divisors of the memory limit, for the memory of one list, of one sorter, of the new offsets of a
// level, and of one window of lookups (node_values.h). Up to three sorters, or four kinds of lists
// of windows (windowed_level.h), exist at the same time.
constexpr uint64_t kListShare = 1024;
constexpr uint64_t kSorterShare = 8;
constexpr uint64_t kValueShare = 4;
constexpr uint64_t kWindowShare = 16;
constexpr uint64_t kLevelShareOf8 = 6;  // eighths of the limit, for a level in memory
constexpr uint64_t kListBufferBytes = uint64_t{16} << 10;

void refuse_unknown(const voxdag_reader::File& file, const GlobalFileWriter& out) {
  if (*name_of(NodeOrder{file.node_order()}) == 0)
    throw Error(
        ErrorCode::kUnsupportedVersion,
        file.path() + ": node order " + std::to_string(file.node_order()) + ", expected 1 or 2");
  for (uint32_t l = 0; l <= file.brick_level() && !file.empty(); ++l)
    if ((file.level(l).pointer_bits == 64) != out.is_wide(file.level(l).word_count))
      throw Error(ErrorCode::kUnsupportedVersion,
                  file.path() + ": level " + std::to_string(l) + ": pointers of " +
                      std::to_string(file.level(l).pointer_bits) + " bits into " +
                      std::to_string(file.level(l).word_count) +
                      " words: expected 64 bits only for large levels");
}

std::vector<GlobalLevel> levels_of(const voxdag_reader::File& file) {
  std::vector<GlobalLevel> levels;
  for (uint32_t l = file.brick_level() + 1; l-- > 0;)
    levels.push_back({file.level(l).node_count, file.level(l).word_count});
  return levels;
}

}  // namespace

void order_levels(const voxdag_reader::File& file, NodeOrder order, const OrderSpace& space,
                  GlobalFileWriter& out, Progress& progress, const CancelToken& cancel) {
  refuse_unknown(file, out);
  out.set_node_order(order);
  if (file.empty()) return;
  const auto share = [&](uint64_t divisor) {
    return std::min(space.memory_bytes / divisor, space.list_bytes);
  };
  const SpillSpace spill{space.folder, space.budget, share(kListShare), share(kSorterShare),
                         std::min(space.list_bytes, kListBufferBytes)};
  const uint64_t level_bytes = std::min(space.memory_bytes / 8 * kLevelShareOf8, space.list_bytes);
  // DagInput releases pages of the file only at intervals, so its limit is lower than the limit of
  // the process.
  DagInput input(file, space.memory_bytes / 8 * 7, cancel);
  progress.begin_stage("reorder", file.dag_nodes(), "nodes");
  with_reader_errors([&] {
    if (order == NodeOrder::kByHash) {
      write_levels_by_hash(input, spill, {share(kValueShare), share(kWindowShare)}, out, progress);
      return;
    }
    out.place_levels(levels_of(file));
    FirstParentOrder(input, spill, level_bytes, out, progress, cancel).write_levels();
    out.finish_placed();
  });
  progress.end_stage();
}

}  // namespace voxdag::query
