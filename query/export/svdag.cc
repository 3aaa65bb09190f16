// .svdag of SymVox / SVDAG-Compression (Jaspe Villanueva, Marton, Gobbetti 2016):
//     f32 x 3 low corner | f32 x 3 high corner | f32 edge | u32 levels | u32 nodes
//     | u32 first leaf | u32 words | u32 ...
// Nodes are stored level by level, the root first: a child mask, then the word index of each child,
// the last child first. A node of the last level is one word with 2^3 voxels. So voxdag's bricks of
// 4^3 voxels are inner nodes in this format.
#include <array>

#include "core/base/text.h"
#include "core/dag/brick.h"
#include "query/export/export_file.h"
#include "query/export/selected_dag.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kMaxSvdagWords = (uint64_t{1} << 32) - 1;  // the word count has 32 bits
// Maximum number of words for viewers whose shaders have 32-bit signed indices.
constexpr uint64_t kMaxViewedWords = (uint64_t{1} << 31) - 1;
constexpr uint32_t kLeafWords = 255;  // one word for each nonzero mask of 8 voxels
constexpr uint64_t kSvdagHeaderBytes = 7 * sizeof(float) + 4 * sizeof(uint32_t);

// Finds the word index at which a brick begins in the output. A brick takes one word, plus one word
// per child. Only the index of every 16th brick is stored; the others are computed from the sizes
// of the bricks in between.
class BrickOffsets {
 public:
  BrickOffsets(const ExportJob& job, const SelectedDag& dag)
      : bricks_(dag.words(dag.brick_level())),
        charge_(job.budget, (bricks_.size() / 2 / kStep + 1) * sizeof(uint64_t),
                "the places of the bricks") {
    begins_.reserve(bricks_.size() / 2 / kStep + 1);
    dag.for_each_brick([&](uint64_t offset, uint64_t mask) {
      if (offset / 2 % kStep == 0) begins_.push_back(words_);
      words_ += words_of(mask);
    });
  }
  uint64_t words() const { return words_; }
  uint64_t of(uint64_t offset) const {
    const uint64_t step = offset / 2 / kStep;
    uint64_t begin = begins_[step];
    for (uint64_t at = 2 * step * kStep; at < offset; at += 2)
      begin += words_of(bricks_[at] | uint64_t{bricks_[at + 1]} << 32);
    return begin;
  }

 private:
  static constexpr uint64_t kStep = 16;
  static uint64_t words_of(uint64_t mask) {
    return 1 + static_cast<uint64_t>(popcount8(octants(mask)));
  }

  const std::span<const uint32_t> bricks_;
  MemoryCharge charge_;
  std::vector<uint64_t> begins_;
  uint64_t words_ = 0;
};

void put_svdag_header(const ExportJob& job, const SelectedDag& dag, uint64_t first_leaf,
                      ExportFile& file) {
  for (size_t axis = 0; axis < 3; ++axis) file.put(static_cast<float>(job.origin(axis)));
  for (size_t axis = 0; axis < 3; ++axis)
    file.put(static_cast<float>(job.origin(axis) + job.file.edge()));
  file.put(static_cast<float>(job.file.edge()));
  file.put(dag.grid_levels());
  file.put(static_cast<uint32_t>(dag.node_count() + kLeafWords));
  file.put(static_cast<uint32_t>(first_leaf));
  file.put(static_cast<uint32_t>(first_leaf + kLeafWords));
}

void put_svdag_nodes(const SelectedDag& dag, const BrickOffsets& bricks, ExportStage& stage,
                     ExportFile& file) {
  uint64_t next_level = 0;
  for (uint32_t level = 0; level < dag.brick_level(); ++level) {
    next_level += dag.words(level).size();
    const bool above_bricks = level + 1 == dag.brick_level();
    dag.for_each_node(level, [&](uint64_t, uint32_t mask, std::span<const uint32_t> children) {
      file.put(mask);
      for (size_t i = children.size(); i-- > 0;)
        file.put(static_cast<uint32_t>(next_level +
                                       (above_bricks ? bricks.of(children[i]) : children[i])));
      stage.advance(1);
    });
  }
}

void put_svdag_bricks(const SelectedDag& dag, uint64_t first_leaf, ExportStage& stage,
                      ExportFile& file) {
  dag.for_each_brick([&](uint64_t, uint64_t mask) {
    file.put(octants(mask));
    for (int i = 7; i >= 0; --i)
      if (const uint64_t voxels = mask >> (8 * i) & 255)
        file.put(static_cast<uint32_t>(first_leaf + voxels - 1));
    stage.advance(1);
  });
  for (uint32_t mask = 1; mask <= kLeafWords; ++mask) file.put(mask);
}

}  // namespace

ExportReport write_svdag(const ExportJob& job) {
  const SelectedDag dag(job);
  const BrickOffsets bricks(job, dag);
  const uint64_t first_leaf =
      dag.word_count() - dag.words(dag.brick_level()).size() + bricks.words();
  const uint64_t words = first_leaf + kLeafWords;
  if (words > kMaxSvdagWords)
    refuse_size(job,
                count_text(words) + " words (" + size_text(4 * words) +
                    ") are needed, but an SVDAG file has at most " + count_text(kMaxSvdagWords),
                [&](uint32_t level) {
                  const SelectedDag::Size size = dag.size_at(level);
                  return size.words + 7 * size.bricks + kLeafWords <= kMaxSvdagWords;
                });
  require_space(job, kSvdagHeaderBytes + 4 * words);
  ExportReport report;
  report.voxels = dag.voxels();
  ExportFile file(job.files, job.output);
  ExportStage stage(job, "export", dag.node_count(), "nodes");
  put_svdag_header(job, dag, first_leaf, file);
  put_svdag_nodes(dag, bricks, stage, file);
  put_svdag_bricks(dag, first_leaf, stage, file);
  ExportFile* const written[] = {&file};
  report.bytes = publish(job, written);
  report.add_fact("words", words);
  if (words > kMaxViewedWords)
    report.notes.push_back("viewers that index words with 31 bits cannot show " +
                           count_text(words) + " words");
  return report;
}

}  // namespace voxdag::query
