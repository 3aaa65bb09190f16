#include "core/format/global/node_index.h"

#include <algorithm>

#include "core/base/parallel_for.h"
#include "core/base/popcount8.h"

namespace voxdag {

NodeIndex::NodeIndex(const voxdag_reader::Level& level, Pointers pointers, unsigned threads,
                     MemoryBudget& budget, const CancelToken& cancel, const std::string& where,
                     PageLimit* pages)
    : level_(level), pointers_(pointers) {
  if (pointers != Pointers::kNone)
    words_ = PageBuffer<NodeWords>(budget, level.word_count / 64 + 1, "an index of nodes");
  const NodeSpans spans(level, pointers, threads, budget, cancel, where, pages, kSpanWords,
                        words_.data());
  count_before(spans.size(), kSpanWords, threads);
}

NodeIndex::NodeIndex(const NodeSpans& spans, uint64_t first, uint64_t end, unsigned threads,
                     MemoryBudget& budget)
    : level_(spans.level()), pointers_(spans.pointers()) {
  const uint64_t first_word = first * spans.span_words();
  level_.words += first_word;
  level_.word_count = std::min(level_.word_count, end * spans.span_words()) - first_word;
  level_.node_count = spans.nodes_before(end) - spans.nodes_before(first);
  if (pointers_ == Pointers::kNone) return;
  words_ = PageBuffer<NodeWords>(budget, level_.word_count / 64 + 1, "an index of nodes");
  parallel_for(threads, end - first, [&](unsigned, size_t i) {
    words_[i * spans.span_words() / 64].before =
        spans.nodes_before(first + i) - spans.nodes_before(first);
    spans.visit_span(first + i, [&](uint64_t, uint64_t at) {
      at -= first_word;
      words_[at / 64].starts |= uint64_t{1} << at % 64;
    });
  });
  count_before(end - first, spans.span_words(), threads);
}

// Sets `before` of all words but the first ones of the spans.
void NodeIndex::count_before(uint64_t spans, uint64_t span_words, unsigned threads) {
  if (words_.size() == 0) return;
  parallel_for(threads, spans, [&](unsigned, size_t span) {
    const uint64_t first = span * span_words / 64;
    const uint64_t end = std::min(first + span_words / 64, words_.size());
    for (uint64_t i = first + 1; i < end; ++i)
      words_[i].before =
          words_[i - 1].before + static_cast<uint64_t>(popcount64(words_[i - 1].starts));
  });
}

uint64_t NodeIndex::last_before(uint64_t span) const {
  uint64_t at = span * kSpanWords - 1;
  if (pointers_ == Pointers::kNone) return at - 1;
  while (find(at) == kNone) --at;
  return at;
}

}  // namespace voxdag
