#include "query/reorder/first_parent.h"

#include <algorithm>
#include <span>
#include <string>

#include "core/base/error.h"
#include "core/base/popcount8.h"
#include "query/reorder/forwarded_level.h"
#include "query/reorder/windowed_level.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kNodesBetweenChecks = 4096;
constexpr uint64_t kMaxNodeWords = global_layout::kMaxNodeWords;

// A node that visit() reads from a queue. `words_ahead` are words of the queue some distance after
// the node. Most of them are child pointers of nodes that are visited soon, so the caller can
// prefetch their targets.
struct QueuedNode {
  uint32_t mask;
  int children;
  const uint32_t* pointers;
  bool is_wide;
  std::span<const uint32_t> words_ahead;

  uint64_t pointer(int i) const { return voxdag_reader::Node{mask, pointers, is_wide}.child(i); }
};

// Writes the nodes of a level to the output file, one after the other.
class LevelOutput {
 public:
  LevelOutput(GlobalFileWriter& out, uint32_t level, bool is_wide, MemoryBudget& budget)
      : out_(out),
        level_(level),
        is_wide_(is_wide),
        words_(budget, kBufferWords, "words of a level") {}

  void add_mask(uint32_t mask) {
    if (count_ + kMaxNodeWords > kBufferWords) flush();
    words_[count_++] = mask;
  }
  void add_pointer(uint64_t offset) {
    words_[count_++] = static_cast<uint32_t>(offset);
    if (is_wide_) words_[count_++] = static_cast<uint32_t>(offset >> 32);
  }
  void flush() {
    out_.write_placed(level_, written_, {words_.data(), count_});
    written_ += count_;
    count_ = 0;
  }

 private:
  static constexpr uint64_t kBufferWords = uint64_t{1} << 16;

  GlobalFileWriter& out_;
  const uint32_t level_;
  const bool is_wide_;
  PageBuffer<uint32_t> words_;
  uint64_t count_ = 0;    // words in the buffer
  uint64_t written_ = 0;  // words in the file
};

std::span<const uint32_t> root_words(DagInput& input) {
  LevelCursor root(input, 0);
  const std::span<const uint32_t> words = root.words();
  if (words.size() != input.level(0).word_count)
    input.corrupt(0, words.size(), "a second root begins here: expected one root");
  return words;
}

}  // namespace

bool FirstParentOrder::is_wide(uint32_t level) const {
  return input_.level(level + 1).pointer_bits == 64;
}

// Calls visit_node(QueuedNode) for each node of the queue, in order. All nodes are on `level`.
template <class Visit>
void FirstParentOrder::visit(uint32_t level, const WordQueue& nodes, const Visit& visit_node) {
  constexpr uint64_t kWordsAhead = 512;
  const bool wide = is_wide(level);
  WordQueueReader reader(nodes, space_.budget);
  uint64_t visited = 0;
  while (!reader.at_end()) {
    const std::span<const uint32_t> words = reader.peek(kWordsAhead + kMaxNodeWords);
    const int children = kPopcount8[words[0]];
    const uint64_t size = 1 + (static_cast<uint64_t>(children) << wide);
    const bool has_ahead = !wide && words.size() >= kWordsAhead + size;
    visit_node(
        QueuedNode{words[0], children, words.data() + 1, wide,
                   has_ahead ? words.subspan(kWordsAhead, size) : std::span<const uint32_t>()});
    reader.skip(size);
    if (++visited % kNodesBetweenChecks == 0) cancel_.check();
  }
}

uint64_t FirstParentOrder::place(uint32_t level, std::span<const uint32_t> words,
                                 WordQueue& queue) const {
  const uint64_t offset = queue.words();
  if (offset + words.size() > input_.level(level).word_count)
    input_.corrupt(level, 0, "its nodes overlap: expected nodes that follow one another");
  queue.add(words);
  return offset;
}

std::unique_ptr<WordQueue> FirstParentOrder::write_in_memory(uint32_t level,
                                                             const WordQueue& nodes) {
  auto next = std::make_unique<WordQueue>(space_.folder, space_.budget);
  ForwardedLevel below(input_, level + 1, space_.budget);
  LevelOutput out(out_, level, is_wide(level), space_.budget);
  const auto place_next = [&](std::span<const uint32_t> words) {
    return place(level + 1, words, *next);
  };
  visit(level, nodes, [&](const QueuedNode& node) {
    for (const uint32_t word : node.words_ahead) below.prefetch(word);
    out.add_mask(node.mask);
    for (int i = 0; i < node.children; ++i) {
      const uint64_t offset = below.find(node.pointer(i), place_next);
      if (offset >= next->words())
        input_.corrupt(level + 1, node.pointer(i),
                       "no node begins here, but a pointer refers to it");
      out.add_pointer(offset);
    }
  });
  out.flush();
  return next;
}

std::unique_ptr<WordQueue> FirstParentOrder::write_in_windows(uint32_t level,
                                                              const WordQueue& nodes) {
  auto next = std::make_unique<WordQueue>(space_.folder, space_.budget);
  WindowedLevel below(input_, level + 1, space_, level_bytes_ / 8, space_.sorter_bytes);
  const auto for_each_pointer = [&](const auto& visit_pointer) {
    visit(level, nodes, [&](const QueuedNode& node) {
      for (int i = 0; i < node.children; ++i) visit_pointer(node.pointer(i));
    });
  };
  for_each_pointer([&](uint64_t child) { below.request(child); });
  below.find_first(cancel_);
  for_each_pointer([&](uint64_t child) {
    const std::span<const uint32_t> words = below.first_to(child);
    if (!words.empty()) below.place(child, place(level + 1, words, *next));
  });
  below.resolve(cancel_);
  LevelOutput out(out_, level, is_wide(level), space_.budget);
  visit(level, nodes, [&](const QueuedNode& node) {
    out.add_mask(node.mask);
    for (int i = 0; i < node.children; ++i) out.add_pointer(below.offset_of(node.pointer(i)));
  });
  out.flush();
  return next;
}

void FirstParentOrder::write_bricks(const WordQueue& bricks) {
  WordQueueReader reader(bricks, space_.budget);
  for (uint64_t written = 0; !reader.at_end();) {
    cancel_.check();
    const auto words = reader.peek(kQueueBufferWords);
    out_.write_placed(input_.file().brick_level(), written, words);
    written += words.size();
    reader.skip(words.size());
  }
}

void FirstParentOrder::write_levels() {
  const uint32_t bricks = input_.file().brick_level();
  auto queue = std::make_unique<WordQueue>(space_.folder, space_.budget);
  queue->add(root_words(input_));
  queue->finish();
  for (uint32_t level = 0; level < bricks; ++level) {
    const voxdag_reader::Level& below = input_.level(level + 1);
    auto next = ForwardedLevel::bytes_of(below) <= level_bytes_ ? write_in_memory(level, *queue)
                                                                : write_in_windows(level, *queue);
    next->finish();
    if (next->words() != below.word_count)
      input_.corrupt(level + 1, next->words(),
                     "the nodes from here on have no parent: expected at least one for each");
    queue = std::move(next);
    progress_.advance(input_.level(level).node_count);
  }
  write_bricks(*queue);
  progress_.advance(input_.level(bricks).node_count);
}

}  // namespace voxdag::query
