#include <algorithm>
#include <set>
#include <string>
#include <tuple>

#include "core/base/error.h"
#include "merge/merger.h"

namespace voxdag {
namespace {

// Giving back less at a time costs more than it is worth.
constexpr uint64_t kMinReleasedBytes = uint64_t{32} << 10;

std::tuple<uint32_t, uint32_t, uint32_t, uint32_t> key_of(const Cube& cube) {
  return {cube.level, cube.position[0], cube.position[1], cube.position[2]};
}

}  // namespace

void Merger::restore(GlobalFileWriter& out) {
  try {
    const std::optional<MergeState> state = journal_.load();
    if (state) go_on_from(*state, out);
  } catch (const Error& error) {
    if (!error.is_corruption()) throw;
    context_.progress.warn("the merge starts over: " + error.message());
    journal_.forget();
    segments_.clear();
    progress_ = {};
    survey(inputs_.artifacts);
  }
  std::set<std::string> named;
  for (const auto& path : journal_.named()) named.insert(path->name());
  context_.scratch.remove_all_but(named);
}

void Merger::go_on_from(const MergeState& state, GlobalFileWriter& out) {
  if (state.inputs != inputs_checksum_)
    throw Error(ErrorCode::kCorrupt, "its subvolumes are not those that it began with");
  context_.scratch.set_next_id(state.next_scratch_id);
  for (const ArtifactRef& ref : state.merged) {
    auto& segment = segments_[ref.segment];
    if (segment) continue;
    segment = std::make_unique<RoundSegment>(context_.scratch, ref.segment);
    journal_.add_named(segment->path());
  }
  replace_inputs(state.merged);
  if (state.last_round) go_on_in_last_round(*state.last_round, out);
  context_.report = state.report;
  rows_before_ = state.report.input_nodes;
}

void Merger::replace_inputs(const std::vector<ArtifactRef>& merged) {
  if (merged.empty()) return;
  std::set<std::tuple<uint32_t, uint32_t, uint32_t, uint32_t>> held;
  const std::vector<SurveyedArtifact> inputs = std::move(artifacts_);
  survey(merged);
  for (const SurveyedArtifact& artifact : artifacts_)
    for (const Cube& cube : artifact.cubes) held.insert(key_of(cube));
  std::vector<ArtifactRef> refs = merged;
  for (const SurveyedArtifact& input : inputs)
    if (!held.contains(key_of(input.cubes[0]))) refs.push_back(input.ref);
  survey(refs);
}

void Merger::go_on_in_last_round(const LastRoundState& state, GlobalFileWriter& out) {
  if (state.output != out.path())
    throw Error(ErrorCode::kInvalidInput, "the merge that goes on has begun to write " +
                                              state.output + ", not " + out.path() +
                                              ": expected the same output, or --restart");
  if (!fit_at_once())
    throw Error(ErrorCode::kOutOfMemory,
                "out of memory: the merge that goes on was begun with more: expected as much "
                "memory as before (--memory), or --restart");
  auto file = std::make_unique<ScratchFile>(context_.scratch, state.map);
  journal_.add_named(file->path());
  uint64_t map_rows = 0;
  for (const uint64_t rows : state.map_rows) map_rows += rows;
  if (state.map_rows.size() != artifacts_.size() + 1 || map_rows != state.map.words)
    throw Error(ErrorCode::kCorrupt, "its maps are not those of its subvolumes");
  progress_.level = state.level;
  progress_.maps.emplace(state.map_rows, std::move(file), context_.plan.resident_bytes,
                         context_.budget);
  progress_.placed = state.placed;
  progress_.roots = state.roots;
  out.go_on(state.file);
  last_round_begun_ = true;
}

MergeState Merger::state_of(std::vector<ArtifactRef> merged) const {
  MergeState state;
  state.inputs = inputs_checksum_;
  state.next_scratch_id = context_.scratch.next_id();
  state.report = context_.report;
  state.merged = std::move(merged);
  return state;
}

void Merger::save_round(RoundSegment& segment, std::vector<ArtifactRef> merged, size_t next) {
  segment.writer().sync();
  for (size_t i = next; i < artifacts_.size(); ++i)
    if (is_round_segment(artifacts_[i].ref.segment)) merged.push_back(artifacts_[i].ref);
  journal_.save_soon(level_read(inputs_.grid_levels), state_of(std::move(merged)), segment_paths(),
                     [] {}, {});
}

void Merger::save_level(const RoundProgress& progress, std::span<const ArtifactReader> readers,
                        GlobalFileWriter& out) {
  const auto map = progress.maps->file(context_.scratch);
  std::vector<ArtifactRef> merged;
  for (const SurveyedArtifact& artifact : artifacts_)
    if (is_round_segment(artifact.ref.segment)) merged.push_back(artifact.ref);
  MergeState state = state_of(std::move(merged));
  state.last_round =
      LastRoundState{*progress.level, out.path(),      out.progress(), progress.maps->rows(),
                     map->record(),   progress.placed, progress.roots};
  auto named = segment_paths();
  named.push_back(map->path());
  const auto sync = [&out, map, &scratch = context_.scratch] {
    out.sync();
    map->sync();
    scratch.files().sync_directory(scratch.path());
  };
  journal_.save_soon(level_read(*progress.level), std::move(state), std::move(named), sync,
                     take_merged(readers, *progress.level));
}

std::vector<MergedBytes> Merger::take_merged(std::span<const ArtifactReader> readers,
                                             uint32_t level) {
  std::vector<MergedBytes> taken;
  merged_ends_.resize(readers.size());
  for (size_t i = 0; i < readers.size(); ++i) {
    const ArtifactRef& ref = artifacts_[i].ref;
    if (is_round_segment(ref.segment)) continue;
    uint64_t end = ref.offset;
    for (const ArtifactLevel& merged : readers[i].levels())
      if (merged.level >= level && !merged.frames.empty())
        end = merged.frames.back().offset + merged.frames.back().bytes;
    const uint64_t begin = std::max(ref.offset, merged_ends_[i]);
    if (end < begin + kMinReleasedBytes) continue;
    taken.push_back({ref.segment, begin, end - begin});
    merged_ends_[i] = end;
  }
  return taken;
}

uint32_t Merger::level_read(uint32_t level) const {
  const auto is_input = [](const SurveyedArtifact& a) { return !is_round_segment(a.ref.segment); };
  return std::ranges::any_of(artifacts_, is_input) ? level : 0;
}

std::vector<std::shared_ptr<ScratchPath>> Merger::segment_paths() const {
  std::vector<std::shared_ptr<ScratchPath>> paths;
  for (const auto& [id, segment] : segments_) paths.push_back(segment->path());
  return paths;
}

}  // namespace voxdag
