#include "merge/checkpoint/merge_recovery.h"

#include <algorithm>
#include <set>
#include <string>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"

namespace voxdag {
namespace {

// Minimum size, in bytes, of a range passed to Checkpoint::release(). newly_merged() omits a
// shorter range; a later call returns these bytes together with the frames of the next levels.
constexpr uint64_t kMinReleasedBytes = uint64_t{32} << 10;

}  // namespace

PassProgress MergeRecovery::restore(GlobalFileWriter& out) {
  PassProgress progress;
  try {
    if (const std::optional<MergeState> state = saver_.load()) progress = resume(*state, out);
  } catch (const Error& error) {
    if (!error.is_corruption()) throw;
    context_.progress.warn("the merge starts over: " + error.message());
    saver_.forget();
    pending_.reset();
  }
  std::set<std::string> named;
  for (const auto& path : saver_.named()) named.insert(path->name());
  context_.scratch.remove_all_but(named);
  return progress;
}

PassProgress MergeRecovery::resume(const MergeState& state, GlobalFileWriter& out) {
  if (state.inputs_checksum != pending_.inputs_checksum())
    throw Error(ErrorCode::kCorrupt,
                "the merge's saved state is of a merge of other subvolumes: expected a merge of "
                "the subvolumes of this build");
  context_.scratch.set_next_id(state.next_scratch_id);
  std::set<uint32_t> segments;
  for (const ArtifactRef& ref : state.intermediates)
    if (segments.insert(ref.segment).second)
      saver_.add_named(
          pending_.add_segment(std::make_unique<PassSegment>(context_.scratch, ref.segment))
              .path());
  pending_.replace_inputs(state.intermediates);
  PassProgress progress;
  if (state.final_pass) progress = resume_final_pass(*state.final_pass, out);
  context_.report = state.report;
  return progress;
}

PassProgress MergeRecovery::resume_final_pass(const FinalPassState& state, GlobalFileWriter& out) {
  if (state.output != out.path())
    throw Error(ErrorCode::kInvalidInput,
                "the interrupted merge was writing " + state.output + ", not " + out.path() +
                    ": expected the same output, or " + option_text("restart"));
  if (!pending_.fit_at_once(context_.plan.partition_bytes))
    throw Error(ErrorCode::kOutOfMemory,
                "out of memory: the interrupted merge used more memory than the " +
                    size_text(context_.plan.partition_bytes) +
                    " that this run has for a part of the merge: expected as much memory as "
                    "before (" +
                    option_text("memory") + "), or " + option_text("restart"));
  if (state.narrow_words != out.narrow_words())
    throw Error(ErrorCode::kCorrupt, "the interrupted merge made levels wide if they have over " +
                                         std::to_string(state.narrow_words) +
                                         " words: expected over " +
                                         std::to_string(out.narrow_words()) + ", as in this merge");
  auto file = std::make_unique<ScratchFile>(context_.scratch, state.map);
  saver_.add_named(file->path());
  uint64_t map_rows = 0;
  for (const uint64_t rows : state.map_rows) map_rows += rows;
  if (state.map_rows.size() != pending_.size() + 1)
    throw Error(ErrorCode::kCorrupt, "the merge's saved state has position maps of " +
                                         std::to_string(state.map_rows.size()) +
                                         " runs: expected " + std::to_string(pending_.size() + 1));
  if (state.map.words != map_rows && state.map.words != 2 * map_rows)
    throw Error(ErrorCode::kCorrupt, "the merge's saved position maps have " +
                                         std::to_string(state.map.words) + " words: expected " +
                                         std::to_string(map_rows) + " or twice as many");
  if (state.file.levels.empty())
    throw Error(ErrorCode::kCorrupt,
                "the merge's saved state has no finished level: expected at least one");
  PassProgress progress;
  progress.level = state.level;
  progress.maps.emplace(state.map_rows, std::move(file), context_.plan.resident_bytes,
                        context_.budget);
  progress.wide = out.is_wide(state.file.levels.back().words);
  progress.placed = state.placed;
  progress.roots = state.roots;
  out.resume(state.file);
  return progress;
}

MergeState MergeRecovery::make_state(std::vector<ArtifactRef> intermediates) const {
  MergeState state;
  state.inputs_checksum = pending_.inputs_checksum();
  state.next_scratch_id = context_.scratch.next_id();
  state.report = context_.report;
  state.intermediates = std::move(intermediates);
  return state;
}

std::vector<ArtifactRef> MergeRecovery::intermediates_from(size_t begin) const {
  std::vector<ArtifactRef> refs;
  for (const SurveyedArtifact& artifact : pending_.artifacts().subspan(begin))
    if (is_pass_segment(artifact.ref.segment)) refs.push_back(artifact.ref);
  return refs;
}

void MergeRecovery::save_in_pass(PassSegment& segment, std::vector<ArtifactRef> merged,
                                 size_t next) {
  segment.writer().sync();
  const std::vector<ArtifactRef> rest = intermediates_from(next);
  merged.insert(merged.end(), rest.begin(), rest.end());
  saver_.save(pending_.has_inputs() ? grid_levels_ : 0, make_state(std::move(merged)),
              pending_.segment_paths(), [] {}, {});
}

void MergeRecovery::save_pass(const PassSegment& segment, std::vector<ArtifactRef> merged,
                              std::span<const SurveyedArtifact> before) {
  std::vector<SegmentRange> rows;
  for (const SurveyedArtifact& artifact : before)
    if (const ArtifactRef& ref = artifact.ref; !is_pass_segment(ref.segment))
      rows.push_back({ref.segment, ref.offset, ref.index_offset - ref.offset});
  saver_.save(
      0, make_state(std::move(merged)), {segment.path()}, [] {}, std::move(rows));
}

void MergeRecovery::save_level(const PassProgress& progress,
                               std::span<const ArtifactReader> readers, GlobalFileWriter& out) {
  const auto map = progress.maps->file(context_.scratch);
  MergeState state = make_state(intermediates_from(0));
  state.final_pass =
      FinalPassState{*progress.level,       out.path(),   out.narrow_words(), out.progress(),
                     progress.maps->rows(), map->state(), progress.placed,    progress.roots};
  auto named = pending_.segment_paths();
  named.push_back(map->path());
  const auto sync = [&out, map, &scratch = context_.scratch] {
    out.sync();
    map->sync();
    scratch.files().sync_directory(scratch.path());
  };
  saver_.save(pending_.has_inputs() ? *progress.level : 0, std::move(state), std::move(named), sync,
              newly_merged(readers, *progress.level));
}

std::vector<SegmentRange> MergeRecovery::newly_merged(std::span<const ArtifactReader> readers,
                                                      uint32_t level) {
  std::vector<SegmentRange> merged;
  merged_ends_.resize(readers.size());
  for (size_t i = 0; i < readers.size(); ++i) {
    const ArtifactRef& ref = pending_.artifacts()[i].ref;
    if (is_pass_segment(ref.segment)) continue;
    // An artifact stores its levels one after another, bricks first. So `level` ends at `end`.
    uint64_t end = ref.offset;
    for (const ArtifactLevel& l : readers[i].levels())
      if (l.level >= level && !l.frames.empty())
        end = l.frames.back().offset + l.frames.back().bytes;
    const uint64_t begin = std::max(ref.offset, merged_ends_[i]);
    if (end < begin + kMinReleasedBytes) continue;
    merged.push_back({ref.segment, begin, end - begin});
    merged_ends_[i] = end;
  }
  return merged;
}

}  // namespace voxdag
