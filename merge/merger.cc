#include "merge/merger.h"

#include <algorithm>
#include <string>

#include "core/base/error.h"
#include "core/format/checksum.h"

namespace voxdag {
namespace {

// How many artifacts at a time: `ends` of consecutive groups.
std::vector<size_t> group_ends(std::span<const SurveyedArtifact> artifacts, uint64_t slab_bytes) {
  std::vector<size_t> ends;
  uint64_t bytes = 0;
  for (size_t i = 0; i < artifacts.size(); ++i) {
    bytes += artifacts[i].min_bytes;
    if (i > 0 && bytes > slab_bytes) {
      ends.push_back(i);
      bytes = artifacts[i].min_bytes;
    }
  }
  ends.push_back(artifacts.size());
  return ends;
}

}  // namespace

Merger::Merger(const MergeInputs& inputs, const MergeContext& context, Checkpoint* checkpoint)
    : inputs_(inputs),
      context_(context),
      journal_(checkpoint, inputs.checkpoint_interval_s),
      open_([this](uint32_t id) {
        return is_round_segment(id) ? segments_.at(id)->open() : inputs_.open_segment(id);
      }),
      // Rounds before the last one also hold a segment's writer.
      round_slab_bytes_(context.plan.slab_bytes -
                        std::min(context.plan.slab_bytes, kSegmentWriterBytes)) {}

void Merger::run(GlobalFileWriter& out) {
  survey(inputs_.artifacts);
  std::vector<uint64_t> contents{inputs_.grid_levels, inputs_.hash_bits};
  for (const SurveyedArtifact& artifact : artifacts_) contents.push_back(artifact.content);
  inputs_checksum_ = checksum64(std::as_bytes(std::span(contents)));
  restore(out);
  context_.progress.begin(fit_at_once() ? rows_ : 2 * rows_);
  while (!last_round_begun_ && !fit_at_once()) {
    reduce();
    context_.progress.set_total(rows_swept() + (fit_at_once() ? rows_ : 2 * rows_));
  }
  merge_last(out);
  journal_.finish();
  context_.progress.end();
}

void Merger::survey(std::span<const ArtifactRef> refs) {
  ArtifactSurvey found = survey_artifacts(refs, open_, inputs_.grid_levels, inputs_.hash_bits);
  artifacts_ = std::move(found.by_place);
  rows_ = found.rows;
}

bool Merger::fit_at_once() const {
  return artifacts_.size() < 2 || group_ends(artifacts_, context_.plan.slab_bytes).size() == 1;
}

uint64_t Merger::rows_swept() const { return context_.report.input_nodes - rows_before_; }

std::vector<ArtifactRoot> Merger::merge(
    std::span<const ArtifactReader> readers, bool last, LevelOutput& output,
    const std::function<void(const RoundProgress&)>& after_level) {
  const RoundTask task{inputs_.grid_levels, inputs_.hash_bits, last, readers};
  return merge_round(context_, task, output, last ? std::move(progress_) : RoundProgress(),
                     after_level);
}

ArtifactSet Merger::open(size_t begin, size_t end) const {
  return ArtifactSet({artifacts_.data() + begin, end - begin}, open_, inputs_.grid_levels,
                     inputs_.hash_bits, context_.budget);
}

void Merger::reduce() {
  const std::vector<size_t> ends = group_ends(artifacts_, round_slab_bytes_);
  if (ends.size() == artifacts_.size())
    throw Error(ErrorCode::kOutOfMemory,
                "out of memory: merging any two neighboring subvolumes takes more than " +
                    std::to_string(context_.budget.available()) + " bytes");
  auto made = std::make_unique<RoundSegment>(context_.scratch, context_.budget);
  RoundSegment& segment = *made;
  segments_[segment.id()] = std::move(made);
  std::vector<ArtifactRef> merged;
  size_t begin = 0;
  for (const size_t end : ends) {
    ArtifactWriter writer(segment.writer(), inputs_.grid_levels, inputs_.hash_bits);
    ArtifactOutput output(writer);
    const auto roots = merge(open(begin, end).readers(), false, output, {});
    merged.push_back(writer.finish(roots));
    begin = end;
    if (begin < artifacts_.size() && journal_.due()) save_round(segment, merged, begin);
  }
  segment.finish();
  ++context_.report.rounds;
  journal_.settle();  // so that what this round merged is given back soon
  const bool due = journal_.due();
  const std::vector<SurveyedArtifact> before = std::move(artifacts_);
  survey(merged);
  std::erase_if(segments_, [&](const auto& entry) { return entry.first != segment.id(); });
  if (!due) return;
  std::vector<MergedBytes> rows;
  for (const auto& artifact : before)
    if (const ArtifactRef& ref = artifact.ref; !is_round_segment(ref.segment))
      rows.push_back({ref.segment, ref.offset, ref.index_offset - ref.offset});
  journal_.save_soon(
      0, state_of(merged), {segment.path()}, [] {}, std::move(rows));
}

void Merger::merge_last(GlobalFileWriter& out) {
  GlobalOutput output(out);
  const ArtifactSet artifacts = open(0, artifacts_.size());
  if (progress_.level) context_.progress.set_total(rows_above(artifacts.readers()));
  const auto after_level = [&](const RoundProgress& progress) {
    if (journal_.due()) save_level(progress, artifacts.readers(), out);
  };
  for (const ArtifactRoot& root : merge(artifacts.readers(), true, output, after_level)) {
    context_.report.voxels += root.voxels;
    context_.report.svo_nodes += root.svo_nodes;
  }
  ++context_.report.rounds;
}

uint64_t Merger::rows_above(std::span<const ArtifactReader> readers) const {
  uint64_t rows = 0;
  for (const ArtifactReader& reader : readers)
    for (const ArtifactLevel& level : reader.levels())
      if (level.level < *progress_.level) rows += level.rows;
  return rows;
}

}  // namespace voxdag
