#include "core/format/verify/child_values.h"

#include <algorithm>
#include <string>

#include "core/base/parallel_for.h"
#include "core/format/verify/verify_order.h"

namespace voxdag {
namespace {

// Pointers in a list have 32 bits. A pointer that does not fit leads to no node, so it can have any
// value that leads to no node.
constexpr int kMaxWindowShift = 31;
constexpr uint64_t kNoOffset = ~uint32_t{0};

}  // namespace

ChildValues::ChildValues(const VerifyTask& task, const NodeSpans& parents,
                         const CheckedLevel& children, uint64_t window_bytes)
    : task_(task),
      parents_(parents),
      children_(children),
      node_words_(SubtreeTable::node_words(children.cube_levels)),
      threads_(task.threads_for_scratch()) {
  choose_windows(window_bytes);
  SpanLists lists(*task.scratch, task.budget, parents.size(), slots_.windows, 1);
  values_ = std::make_unique<SpanFile>(*task.scratch, task.budget, parents.size());
  list_pointers(lists);
  for (uint64_t window = 0; window < slots_.windows; ++window) find_values(lists, window);
}

uint64_t ChildValues::scratch_words(const NodeSpans& parents, const CheckedLevel& children) {
  const voxdag_reader::Level& level = parents.level();
  const uint64_t pointers =
      (level.word_count - level.node_count) >> (parents.pointers() == Pointers::kWide);
  return pointers * (1 + SubtreeTable::node_words(children.cube_levels));
}

// Makes the windows as large as `window_bytes` permits. They have equal numbers of words, powers of
// two.
void ChildValues::choose_windows(uint64_t window_bytes) {
  const NodeSpans& spans = children_.spans;
  const bool are_bricks = spans.pointers() == Pointers::kNone;
  const auto fits = [&](int shift) {
    const uint64_t words = uint64_t{1} << shift;
    const uint64_t step = words / spans.span_words();
    for (uint64_t first = 0; first < spans.size(); first += step)
      if (LevelWindow::bytes(are_bricks, children_.cube_levels, words,
                             spans.nodes_before(first + step) - spans.nodes_before(first)) >
          window_bytes)
        return false;
    return true;
  };
  int shift = std::countr_zero(spans.span_words());
  while (shift < kMaxWindowShift && fits(shift + 1)) ++shift;
  slots_.window_shift = shift;
  slots_.windows = ((spans.level().word_count - 1) >> shift) + 1;
}

// Calls visit(pointer) for the pointers of the last node before the span, and of the nodes in the
// span.
template <class Visit>
void ChildValues::visit_pointers(uint64_t span, const Visit& visit) const {
  const auto visit_node = [&](uint64_t at) {
    const voxdag_reader::Node node = verified_node(task_.file, children_.level - 1, at);
    for (int c = 0; c < popcount8(node.child_mask); ++c) visit(node.child(c));
  };
  if (span > 0) visit_node(parents_.last_before(span));
  parents_.visit_span(span, [&](uint64_t, uint64_t at) { visit_node(at); });
}

void ChildValues::list_pointers(SpanLists& lists) {
  std::vector<SpanLists::Buffer> buffers(threads_);
  parallel_for(threads_, parents_.size(), [&](unsigned worker, size_t span) {
    task_.cancel.check();
    const uint64_t pointers = lists.write(span, buffers[worker], [&](const auto& add) {
      visit_pointers(span, [&](uint64_t pointer) {
        const uint64_t window = slots_.window_of(pointer);
        const auto item =
            static_cast<uint32_t>(std::min(pointer - (window << slots_.window_shift), kNoOffset));
        add(window, &item);
      });
    });
    values_->reserve(span, pointers * node_words_);
    task_.progress.advance(parents_.nodes_before(span + 1) - parents_.nodes_before(span));
    task_.pages.touch(sizeof(uint32_t) * parents_.span_words());
  });
}

void ChildValues::find_values(SpanLists& lists, uint64_t window) {
  const uint64_t step = (uint64_t{1} << slots_.window_shift) / children_.spans.span_words();
  const uint64_t first = window * step;
  LevelWindow loaded(task_, threads_, children_, first,
                     std::min(first + step, children_.spans.size()));
  const uint64_t nodes = loaded.table.size(), spans = parents_.size();
  std::vector<Buffer> buffers(threads_);
  parallel_for(threads_, spans, [&](unsigned worker, size_t span) {
    task_.cancel.check();
    Buffer& buffer = buffers[worker];
    append_values(span, lists.next(span, window, buffer.lists), loaded, buffer);
    task_.progress.advance(nodes * (span + 1) / spans - nodes * span / spans);
  });
  if (first_orphan_ != NodeIndex::kNone) return;
  if (const uint64_t orphan = voxdag::first_orphan(task_, loaded.table); orphan != NodeIndex::kNone)
    first_orphan_ = children_.spans.nodes_before(first) + orphan;
}

void ChildValues::append_values(uint64_t span, std::span<const uint32_t> pointers,
                                LevelWindow& window, Buffer& buffer) {
  constexpr size_t kBatch = 64;  // lookups whose cache misses overlap
  const NodeIndex::Lookup index = window.index.lookup();
  const SubtreeWords table = window.table.words();
  buffer.values.resize(pointers.size() * node_words_);
  const SubtreeWords found{buffer.values.data(), table.is_small};
  uint64_t children[kBatch];
  for (size_t first = 0; first < pointers.size(); first += kBatch) {
    const auto batch = pointers.subspan(first, std::min(kBatch, pointers.size() - first));
    for (const uint32_t pointer : batch) index.prefetch(pointer);
    for (size_t i = 0; i < batch.size(); ++i) {
      children[i] = index.find(batch[i]);
      if (children[i] != NodeIndex::kNone) table.prefetch(children[i]);
    }
    for (size_t i = 0; i < batch.size(); ++i)
      if (children[i] != NodeIndex::kNone)
        table.copy_to_parent(children[i], found.node(first + i));
      else
        found.set_broken(first + i);
  }
  values_->append(span, buffer.values);
}

NodeLevel ChildValues::load(uint64_t span, Buffer& buffer) const {
  buffer.values.resize(values_->words(span));
  values_->read(span, buffer.values);
  // Counts the pointers into each window. A window's first value follows the last value of
  // the window before it.
  buffer.next.assign(slots_.windows, 0);
  visit_pointers(span, [&](uint64_t pointer) { ++buffer.next[slots_.window_of(pointer)]; });
  uint32_t before = 0;
  for (uint32_t& next : buffer.next) before += std::exchange(next, before);
  buffer.slots = slots_;
  buffer.slots.next = buffer.next.data();
  buffer.slots.count = buffer.values.size() / node_words_;
  NodeLevel level;
  level.children = {buffer.values.data(), node_words_ == SubtreeTable::node_words(0)};
  level.slots = &buffer.slots;
  return level;
}

LevelWindow::LevelWindow(const VerifyTask& task, unsigned threads, const CheckedLevel& level,
                         uint64_t first, uint64_t end)
    : index(level.spans, first, end, threads, task.budget, task.pages),
      table(task.budget, level.spans.nodes_before(end) - level.spans.nodes_before(first),
            level.cube_levels) {
  const uint64_t before = level.spans.nodes_before(first);
  parallel_for(threads, end - first, [&](unsigned, size_t i) {
    task.cancel.check();
    const uint64_t node = level.spans.nodes_before(first + i);
    level.values->read(
        first + i, table.words_of(node - before, level.spans.nodes_before(first + i + 1) - node));
  });
  task.pages.check();
}

}  // namespace voxdag
