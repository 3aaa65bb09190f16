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
uint64_t NodeIndex::words_of_node(uint64_t at) const {
  const uint32_t mask = level_.words[at];
  if (mask == 0 || mask > 255) return 0;
  return 1 + (uint64_t{kPopcount8[mask]} << (pointers_ == Pointers::kWide));
}

// Returns the first word of the span at which a node seems to begin.
uint64_t NodeIndex::guess_begin(uint64_t span) const {
  const uint64_t first = span * kSpanWords;
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

// Walks the nodes of the span, the first of which begins at word `begin`. Marks in words_ the words
// at which nodes begin.
NodeIndex::Span NodeIndex::walk(uint64_t span, uint64_t begin) {
  const uint64_t end = std::min(level_.word_count, (span + 1) * kSpanWords);
  for (uint64_t i = span * kSpanWords / 64; i * 64 < end; ++i) words_[i].starts = 0;
  Span walked{.begin = begin, .end = begin};
  while (walked.end < end) {
    const uint64_t words = words_of_node(walked.end);
    walked.broken = words == 0;
    if (walked.broken) break;
    words_[walked.end / 64].starts |= uint64_t{1} << walked.end % 64;
    ++walked.nodes;
    walked.end += words;
  }
  return walked;
}

// Walks each span again whose guessed beginning is not the end of the previous span's last node.
// Returns the number of nodes of the level. Sets Words::before at the beginning of each span.
uint64_t NodeIndex::join(std::span<Span> spans, const CancelToken& cancel,
                         const std::string& where) {
  uint64_t nodes = 0, at = 0;
  for (uint64_t span = 0; span < spans.size(); ++span) {
    if (spans[span].begin != at) {
      cancel.check();
      spans[span] = walk(span, at);
    }
    at = spans[span].end;
    if (spans[span].broken)
      throw Error(ErrorCode::kCorrupt, where + ", word " + std::to_string(at) + ": child mask " +
                                           std::to_string(level_.words[at]) +
                                           ", expected 1 to 255");
    words_[span * kSpanWords / 64].before = nodes;
    nodes += spans[span].nodes;
  }
  if (at != level_.word_count)
    throw Error(ErrorCode::kCorrupt, where + ": its last node ends at word " + std::to_string(at) +
                                         ", expected word " + std::to_string(level_.word_count) +
                                         ", where the level ends");
  return nodes;
}

NodeIndex::NodeIndex(const voxdag_reader::Level& level, Pointers pointers, unsigned threads,
                     MemoryBudget& budget, const CancelToken& cancel, const std::string& where,
                     PageLimit* pages)
    : level_(level), pointers_(pointers) {
  const auto miscounted = [&](uint64_t nodes) {
    throw Error(ErrorCode::kCorrupt, where + ": its words hold " + std::to_string(nodes) +
                                         " nodes, expected " + std::to_string(level.node_count));
  };
  if (pointers == Pointers::kNone) {
    if (level.word_count != 2 * level.node_count) miscounted(level.word_count / 2);
    return;
  }
  words_ = PageBuffer<Words>(budget, level.word_count / 64 + 1, "an index of nodes");
  PageBuffer<Span> spans(budget, span_count(), "an index of nodes");
  parallel_for(threads, spans.size(), [&](unsigned, size_t span) {
    cancel.check();
    spans[span] = walk(span, guess_begin(span));
    if (pages) pages->touch(sizeof(uint32_t) * kSpanWords);
  });
  const uint64_t nodes = join({spans.data(), spans.size()}, cancel, where);
  if (nodes != level.node_count) miscounted(nodes);
  parallel_for(threads, spans.size(), [&](unsigned, size_t span) {
    const uint64_t first = span * kSpanWords / 64;
    const uint64_t end = std::min(first + kSpanWords / 64, words_.size());
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
