#include "query/reorder/windowed_level.h"

#include <algorithm>
#include <bit>

#include "core/base/popcount8.h"

namespace voxdag::query {
namespace {

// Memory for one word of a window. find_first() needs the word, and a bit that is set if a
// requested node begins there. resolve() needs half of a new offset.
constexpr uint64_t kBytesOfWord = 5;
constexpr uint64_t kItemsPerCheck = uint64_t{1} << 16;  // between two checks of the cancel token
constexpr uint64_t kMinWindowWords = 64, kMaxWindowWords = uint64_t{1} << 31;

}  // namespace

WindowedLevel::WindowedLevel(DagInput& input, uint32_t level, const SpillSpace& space,
                             uint64_t window_bytes, uint64_t list_bytes)
    : input_(input),
      level_(level),
      space_(space),
      list_bytes_(list_bytes),
      words_(input.level(level).word_count),
      is_brick_level_(level == input.file().brick_level()),
      is_wide_(!is_brick_level_ && input.level(level + 1).pointer_bits == 64) {
  const uint64_t window_words =
      std::clamp(window_bytes / kBytesOfWord, kMinWindowWords, kMaxWindowWords);
  window_shift_ = std::bit_width(window_words) - 1;
  windows_ = (words_ >> window_shift_) + 1;
  requests_ = make_lists<uint32_t>();
}

void WindowedLevel::no_node(uint64_t offset) const {
  input_.corrupt(level_, offset, "no node begins here, but a pointer refers to it");
}

void WindowedLevel::request(uint64_t offset) {
  if (offset >= words_) no_node(offset);
  const uint64_t window = offset >> window_shift_;
  requests_->add(window, static_cast<uint32_t>(offset - (window << window_shift_)));
}

// Returns the number of words of the node or brick at `offset`, whose first word is `first_word`.
uint64_t WindowedLevel::node_words(uint64_t offset, uint32_t first_word) const {
  if (!is_brick_level_ && (first_word == 0 || first_word > 255)) no_node(offset);
  const uint64_t count = is_brick_level_ ? 2 : 1 + (uint64_t{kPopcount8[first_word]} << is_wide_);
  if (count > words_ - offset) no_node(offset);
  return count;
}

void WindowedLevel::find_first(const CancelToken& cancel) {
  requests_->finish();
  sizes_ = make_lists<uint32_t>();
  nodes_ = make_lists<uint32_t>();
  uint64_t node = 0;
  for (size_t window = 0; window < windows_; ++window) find_first(window, node, cancel);
  sizes_->finish();
  nodes_->finish();
  placed_ = make_lists<uint64_t>();
}

// Reads the requests of a window. `node` is the offset of the first node that begins in the window,
// and receives the offset of the first node that begins after it.
void WindowedLevel::find_first(size_t window, uint64_t& node, const CancelToken& cancel) {
  constexpr uint64_t kChunkWords = uint64_t{1} << 16;
  const uint64_t begin = uint64_t{window} << window_shift_;
  const uint64_t end = std::min(begin + (uint64_t{1} << window_shift_), words_);
  const uint64_t loaded = std::min(end + global_layout::kMaxNodeWords, words_) - begin;
  PageBuffer<uint32_t> words(space_.budget, loaded, "nodes of a level");
  PageBuffer<uint64_t> requested(space_.budget, (end - begin) / 64 + 1, "nodes of a level");
  for (uint64_t first = 0; first < loaded; first += kChunkWords) {
    cancel.check();
    std::ranges::copy(input_.words(level_, begin + first, std::min(kChunkWords, loaded - first)),
                      words.data() + first);
  }
  for (uint64_t left = requests_->size(window); left > 0; --left) {
    if (left % kItemsPerCheck == 0) cancel.check();
    const uint64_t at = requests_->next(window), bit = uint64_t{1} << at % 64;
    if (requested[at / 64] & bit) {
      sizes_->add(window, 0);
      continue;
    }
    requested[at / 64] |= bit;
    const uint64_t count = node_words(begin + at, words[at]);
    sizes_->add(window, static_cast<uint32_t>(count));
    for (uint64_t i = 0; i < count; ++i) nodes_->add(window, words[at + i]);
  }
  requests_->rewind(window);
  cancel.check();
  for (; node < end; node += node_words(node, words[node - begin])) {
    uint64_t& bits = requested[(node - begin) / 64];
    const uint64_t bit = uint64_t{1} << (node - begin) % 64;
    if (!(bits & bit))
      input_.corrupt(level_, node, "the node has no parent: expected at least one");
    bits &= ~bit;
  }
  for (uint64_t i = 0; i < requested.size(); ++i)
    if (requested[i] != 0)
      no_node(begin + 64 * i + static_cast<uint64_t>(std::countr_zero(requested[i])));
}

std::span<const uint32_t> WindowedLevel::first_to(uint64_t offset) {
  const uint64_t window = offset >> window_shift_;
  const uint32_t count = sizes_->next(window);
  for (uint32_t i = 0; i < count; ++i) node_[i] = nodes_->next(window);
  return {node_.data(), count};
}

void WindowedLevel::resolve(const CancelToken& cancel) {
  sizes_.reset();
  nodes_.reset();
  placed_->finish();
  answers_ = make_lists<uint64_t>();
  const uint64_t slots = (uint64_t{1} << window_shift_) / 2;
  for (size_t window = 0; window < windows_; ++window) {
    cancel.check();
    // Every node has at least two words, and nodes do not overlap, so each node has its own slot.
    // The slot has 1 plus the new offset, or 0 before the first request.
    PageBuffer<uint64_t> placed(space_.budget, slots, "offsets of a level");
    for (uint64_t left = requests_->size(window); left > 0; --left) {
      if (left % kItemsPerCheck == 0) cancel.check();
      uint64_t& slot = placed[requests_->next(window) / 2];
      if (slot == 0) slot = placed_->next(window) + 1;
      answers_->add(window, slot - 1);
    }
  }
  requests_.reset();
  placed_.reset();
  answers_->finish();
}

}  // namespace voxdag::query
