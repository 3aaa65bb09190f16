#include "merge/plan/pending_artifacts.h"

#include <algorithm>
#include <set>

#include "core/format/checksum.h"

namespace voxdag {

PendingArtifacts::PendingArtifacts(const MergeInputs& inputs, uint64_t narrow_words)
    : inputs_(inputs), narrow_words_(narrow_words), open_([this](uint32_t id) {
        return is_pass_segment(id) ? segments_.at(id)->open() : inputs_.open_segment(id);
      }) {
  survey(inputs.artifacts);
  std::vector<uint64_t> words{inputs.shape.grid_levels, inputs.shape.hash_bits};
  for (const SurveyedArtifact& artifact : artifacts_) words.push_back(artifact.content_checksum);
  inputs_checksum_ = checksum64(std::as_bytes(std::span(words)));
}

bool PendingArtifacts::has_inputs() const {
  return std::ranges::any_of(
      artifacts_, [](const SurveyedArtifact& a) { return !is_pass_segment(a.ref.segment); });
}

std::vector<size_t> PendingArtifacts::group_ends(uint64_t partition_bytes,
                                                 uint64_t max_rows) const {
  std::vector<size_t> ends;
  uint64_t bytes = 0, rows = 0;
  for (size_t i = 0; i < artifacts_.size(); ++i) {
    bytes += artifacts_[i].min_bytes;
    rows += artifacts_[i].rows;
    if (i > 0 && (bytes > partition_bytes || rows > max_rows)) {
      ends.push_back(i);
      bytes = artifacts_[i].min_bytes;
      rows = artifacts_[i].rows;
    }
  }
  ends.push_back(artifacts_.size());
  return ends;
}

ArtifactSet PendingArtifacts::open(size_t begin, size_t end, MemoryBudget& budget) const {
  return ArtifactSet({artifacts_.data() + begin, end - begin}, open_, inputs_.shape, budget);
}

PassSegment& PendingArtifacts::add_segment(std::unique_ptr<PassSegment> segment) {
  PassSegment& added = *segment;
  segments_[added.id()] = std::move(segment);
  return added;
}

std::vector<std::shared_ptr<ScratchPath>> PendingArtifacts::segment_paths() const {
  std::vector<std::shared_ptr<ScratchPath>> paths;
  for (const auto& [id, segment] : segments_) paths.push_back(segment->path());
  return paths;
}

std::vector<SurveyedArtifact> PendingArtifacts::replace_all(const std::vector<ArtifactRef>& merged,
                                                            const PassSegment& segment) {
  std::vector<SurveyedArtifact> replaced = std::move(artifacts_);
  survey(merged);
  std::erase_if(segments_, [&](const auto& entry) { return entry.first != segment.id(); });
  return replaced;
}

void PendingArtifacts::replace_inputs(const std::vector<ArtifactRef>& intermediates) {
  if (intermediates.empty()) return;
  std::set<Cube> merged_cubes;
  const std::vector<SurveyedArtifact> inputs = std::move(artifacts_);
  survey(intermediates);
  for (const SurveyedArtifact& artifact : artifacts_)
    for (const Cube& cube : artifact.cubes) merged_cubes.insert(cube);
  std::vector<ArtifactRef> refs = intermediates;
  for (const SurveyedArtifact& input : inputs)
    if (!merged_cubes.contains(input.cubes[0])) refs.push_back(input.ref);
  survey(refs);
}

void PendingArtifacts::reset() {
  segments_.clear();
  survey(inputs_.artifacts);
}

void PendingArtifacts::survey(std::span<const ArtifactRef> refs) {
  // First surveys with `wide` = false. This is right if no level of the output has more than
  // narrow_words_ words. That is certain if all rows together have at most narrow_words_ words. A
  // row has at most nine words; the division by 10 also covers the few rows of the top tree.
  ArtifactSurvey found = survey_artifacts(refs, open_, inputs_.shape, false);
  if (found.rows > narrow_words_ / 10) found = survey_artifacts(refs, open_, inputs_.shape, true);
  artifacts_ = std::move(found.in_morton_order);
  rows_ = found.rows;
}

}  // namespace voxdag
