#include "core/format/global/node_index.h"

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/base/popcount8.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/page_limit.h"

namespace voxdag {
namespace {

// A word is accepted as the beginning of a node if this many valid nodes follow one another from
// it. A wrong word almost never begins a chain of this length. If it does, join() corrects it.
constexpr int kConvincingNodes = 32;

}  // namespace

// Returns the number of words of the node at word `at`; 0 if no node can begin there.
uint64_t NodeSpans::words_of_node(uint64_t at) const {
  const uint32_t mask = level_.words[at];
  if (mask == 0 || mask > 255) return 0;
  return 1 + (uint64_t{kPopcount8[mask]} << is_wide());
}

// Returns the first word of the span at which a node seems to begin.
uint64_t NodeSpans::guess_begin(uint64_t span) const {
  const uint64_t first = span * span_words_;
  const auto is_convincing = [&](uint64_t at) {
    for (int node = 0; node < kConvincingNodes && at < level_.word_count; ++node) {
      const uint64_t words = words_of_node(at);
      if (words == 0) return false;
      at += words;
    }
    return at <= level_.word_count;
  };
  if (span == 0) return 0;
  for (uint64_t at = first; at < std::min(first + global_layout::kMaxNodeWords, level_.word_count);
       ++at)
    if (is_convincing(at)) return at;
  return first;
}

// Walks the nodes of the span, the first of which begins at word `begin`. Marks the words at which
// nodes begin.
NodeSpans::Span NodeSpans::walk(uint64_t span, uint64_t begin, NodeWords* marks) const {
  const uint64_t end = std::min(level_.word_count, (span + 1) * span_words_);
  if (marks)
    for (uint64_t i = span * span_words_ / 64; i * 64 < end; ++i) marks[i].starts = 0;
  Span walked{.begin = begin, .last = begin};
  for (uint64_t at = begin, words = 0; at < end; at += words) {
    words = words_of_node(at);
    walked.last = at;
    walked.last_words = static_cast<uint16_t>(words);
    walked.is_broken = words == 0;
    if (walked.is_broken) break;
    if (marks) marks[at / 64].starts |= uint64_t{1} << at % 64;
    ++walked.nodes;
  }
  return walked;
}

// Walks each span again whose guessed beginning is not the end of the previous span's last node.
// Returns the number of nodes of the level. Sets `before` of all spans and, in `marks`, at the
// beginning of each span.
uint64_t NodeSpans::join(NodeWords* marks, const CancelToken& cancel, const std::string& where) {
  uint64_t nodes = 0, at = 0;
  for (uint64_t span = 0; span < spans_.size(); ++span) {
    if (spans_[span].begin != at) {
      cancel.check();
      spans_[span] = walk(span, at, marks);
    }
    at = spans_[span].end();
    if (spans_[span].is_broken)
      throw Error(ErrorCode::kCorrupt, where + ", word " + std::to_string(at) + ": child mask " +
                                           std::to_string(level_.words[at]) +
                                           ", expected 1 to 255");
    spans_[span].before = nodes;
    if (marks) marks[span * span_words_ / 64].before = nodes;
    nodes += spans_[span].nodes;
  }
  if (at != level_.word_count)
    throw Error(ErrorCode::kCorrupt, where + ": its last node ends at word " + std::to_string(at) +
                                         ", expected word " + std::to_string(level_.word_count) +
                                         ", where the level ends");
  return nodes;
}

NodeSpans::NodeSpans(const voxdag_reader::Level& level, Pointers pointers, unsigned threads,
                     MemoryBudget& budget, const CancelToken& cancel, const std::string& where,
                     PageLimit* pages, uint64_t span_words, NodeWords* marks)
    : level_(level), pointers_(pointers), span_words_(span_words) {
  const auto miscounted = [&](uint64_t nodes) {
    throw Error(ErrorCode::kCorrupt, where + ": its words hold " + std::to_string(nodes) +
                                         " nodes, expected " + std::to_string(level.node_count));
  };
  if (pointers == Pointers::kNone) {
    if (level.word_count != 2 * level.node_count) miscounted(level.word_count / 2);
    return;
  }
  spans_ = PageBuffer<Span>(budget, size(), "an index of nodes");
  parallel_for(threads, spans_.size(), [&](unsigned, size_t span) {
    cancel.check();
    spans_[span] = walk(span, guess_begin(span), marks);
    if (pages) pages->touch(sizeof(uint32_t) * span_words_);
  });
  const uint64_t nodes = join(marks, cancel, where);
  if (nodes != level.node_count) miscounted(nodes);
}

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
                     MemoryBudget& budget, PageLimit& pages)
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
      // Only if the file has changed since the spans were made, a node can begin outside its span.
      if (at / spans.span_words() != first + i) return;
      at -= first_word;
      words_[at / 64].starts |= uint64_t{1} << at % 64;
    });
    pages.touch(sizeof(uint32_t) * spans.span_words());
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
