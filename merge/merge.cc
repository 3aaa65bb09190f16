#include "merge/merge.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "merge/artifact_set.h"
#include "merge/level_output.h"
#include "merge/memory_plan.h"
#include "merge/merge_journal.h"
#include "merge/round.h"
#include "merge/round_segment.h"
#include "merge/scratch.h"

namespace voxdag {
namespace {

// Giving back less at a time costs more than it is worth.
constexpr uint64_t kLeastReleasedBytes = uint64_t{32} << 10;

// How many artifacts at a time: `ends` of consecutive groups.
std::vector<size_t> group_ends(std::span<const SurveyedArtifact> artifacts, uint64_t slab_bytes) {
  std::vector<size_t> ends;
  uint64_t bytes = 0;
  for (size_t i = 0; i < artifacts.size(); ++i) {
    bytes += artifacts[i].least_bytes;
    if (i > 0 && bytes > slab_bytes) {
      ends.push_back(i);
      bytes = artifacts[i].least_bytes;
    }
  }
  ends.push_back(artifacts.size());
  return ends;
}

std::tuple<uint32_t, uint32_t, uint32_t, uint32_t> key_of(const Cube& cube) {
  return {cube.level, cube.position[0], cube.position[1], cube.position[2]};
}

// A state that these speak of cannot be gone on with; other errors say nothing of it.
bool speaks_of_damage(const Error& error) {
  return error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kNotFound ||
         error.code() == ErrorCode::kUnsupportedVersion;
}

class Merger {
 public:
  Merger(const MergeInputs& inputs, const MergeSeams& seams, Checkpoint* checkpoint)
      : inputs_(inputs),
        seams_(seams),
        journal_(checkpoint, inputs.checkpoint_interval_s),
        open_([this](uint32_t id) {
          return is_round_segment(id) ? segments_.at(id)->open() : inputs_.open_segment(id);
        }),
        // Rounds before the last one also hold a segment's writer.
        round_slab_bytes_(seams.plan.slab_bytes -
                          std::min(seams.plan.slab_bytes, kSegmentWriterBytes)) {}

  void run(GlobalFileWriter& out) {
    survey(inputs_.artifacts);
    std::vector<uint64_t> contents{inputs_.grid_levels, inputs_.hash_bits};
    for (const SurveyedArtifact& artifact : artifacts_) contents.push_back(artifact.content);
    inputs_checksum_ = checksum64(std::as_bytes(std::span(contents)));
    restore(out);
    seams_.progress.begin(fit_at_once() ? rows_ : 2 * rows_);
    while (!last_round_begun_ && !fit_at_once()) {
      reduce();
      seams_.progress.set_total(rows_swept() + (fit_at_once() ? rows_ : 2 * rows_));
    }
    merge_last(out);
    seams_.progress.end();
  }

 private:
  // Finds out about the artifacts to merge next.
  void survey(std::span<const ArtifactRef> refs) {
    ArtifactSurvey found = survey_artifacts(refs, open_, inputs_.grid_levels, inputs_.hash_bits);
    artifacts_ = std::move(found.by_place);
    rows_ = found.rows;
  }

  bool fit_at_once() const {
    return artifacts_.size() < 2 || group_ends(artifacts_, seams_.plan.slab_bytes).size() == 1;
  }

  uint64_t rows_swept() const { return seams_.report.input_nodes - rows_before_; }

  // Goes on from the state that an earlier merge saved, if there is one that fits.
  void restore(GlobalFileWriter& out) {
    try {
      const std::optional<MergeState> state = journal_.load();
      if (state) go_on_from(*state, out);
    } catch (const Error& error) {
      if (!speaks_of_damage(error)) throw;
      seams_.progress.warn("the merge starts over: " + error.message());
      journal_.forget();
      segments_.clear();
      progress_ = {};
      survey(inputs_.artifacts);
    }
    std::set<std::string> named;
    for (const auto& path : journal_.named()) named.insert(path->name());
    seams_.scratch.remove_all_but(named);
  }

  void go_on_from(const MergeState& state, GlobalFileWriter& out) {
    if (state.inputs != inputs_checksum_)
      throw Error(ErrorCode::kCorrupt, "its subvolumes are not those that it began with");
    seams_.scratch.set_next_id(state.next_scratch_id);
    for (const ArtifactRef& ref : state.merged) {
      auto& segment = segments_[ref.segment];
      if (segment) continue;
      segment = std::make_unique<RoundSegment>(seams_.scratch, ref.segment);
      journal_.add_named(segment->path());
    }
    replace_inputs(state.merged);
    if (state.last_round) go_on_in_last_round(*state.last_round, out);
    seams_.report = state.report;
    rows_before_ = state.report.input_nodes;
  }

  // Artifacts of rounds take the place of the inputs whose roots they hold.
  void replace_inputs(const std::vector<ArtifactRef>& merged) {
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

  void go_on_in_last_round(const LastRoundState& state, GlobalFileWriter& out) {
    if (state.output != out.path())
      throw Error(ErrorCode::kInvalidInput, "the merge that goes on has begun to write " +
                                                state.output + ", not " + out.path() +
                                                ": expected the same output, or --restart");
    if (!fit_at_once())
      throw Error(ErrorCode::kOutOfMemory,
                  "out of memory: the merge that goes on was begun with more: expected as much "
                  "memory as before (--memory), or --restart");
    auto file = std::make_unique<ScratchFile>(seams_.scratch, state.map);
    journal_.add_named(file->path());
    uint64_t map_rows = 0;
    for (const uint64_t rows : state.map_rows) map_rows += rows;
    if (state.map_rows.size() != artifacts_.size() + 1 || map_rows != state.map.words)
      throw Error(ErrorCode::kCorrupt, "its maps are not those of its subvolumes");
    progress_.level = state.level;
    progress_.maps.emplace(state.map_rows, std::move(file), seams_.plan.resident_bytes,
                           seams_.budget);
    progress_.placed = state.placed;
    progress_.roots = state.roots;
    out.go_on(state.levels);
    last_round_begun_ = true;
  }

  std::vector<ArtifactRoot> merge(std::span<const ArtifactReader> readers, bool last,
                                  LevelOutput& output,
                                  const std::function<void(const RoundProgress&)>& after_level) {
    const RoundTask task{inputs_.grid_levels, inputs_.hash_bits, last, readers};
    return merge_round(seams_, task, output, last ? std::move(progress_) : RoundProgress(),
                       after_level);
  }

  ArtifactSet open(size_t begin, size_t end) const {
    return ArtifactSet({artifacts_.data() + begin, end - begin}, open_, inputs_.grid_levels,
                       inputs_.hash_bits, seams_.budget);
  }

  // Merges groups of artifacts into one artifact each.
  void reduce() {
    const std::vector<size_t> ends = group_ends(artifacts_, round_slab_bytes_);
    if (ends.size() == artifacts_.size())
      throw Error(ErrorCode::kOutOfMemory,
                  "out of memory: merging any two neighbouring subvolumes takes more than " +
                      std::to_string(seams_.budget.available()) + " bytes");
    auto made = std::make_unique<RoundSegment>(seams_.scratch, seams_.budget);
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
    ++seams_.report.rounds;
    const bool due = journal_.due();
    const std::vector<SurveyedArtifact> before = std::move(artifacts_);
    survey(merged);
    std::erase_if(segments_, [&](const auto& entry) { return entry.first != segment.id(); });
    if (!due) return;
    journal_.save(0, state_of(merged), {segment.path()});
    for (const SurveyedArtifact& artifact : before)
      if (!is_round_segment(artifact.ref.segment))
        journal_.release(artifact.ref.segment, artifact.ref.offset,
                         artifact.ref.index_offset - artifact.ref.offset);
  }

  MergeState state_of(std::vector<ArtifactRef> merged) const {
    MergeState state;
    state.inputs = inputs_checksum_;
    state.next_scratch_id = seams_.scratch.next_id();
    state.report = seams_.report;
    state.merged = std::move(merged);
    return state;
  }

  // In the midst of a round: `merged` replace the artifacts before `next`.
  void save_round(RoundSegment& segment, std::vector<ArtifactRef> merged, size_t next) {
    segment.writer().sync();
    for (size_t i = next; i < artifacts_.size(); ++i)
      if (is_round_segment(artifacts_[i].ref.segment)) merged.push_back(artifacts_[i].ref);
    journal_.save(level_read(inputs_.grid_levels), state_of(std::move(merged)), segment_paths());
  }

  void merge_last(GlobalFileWriter& out) {
    GlobalOutput output(out);
    const ArtifactSet artifacts = open(0, artifacts_.size());
    if (progress_.level) seams_.progress.set_total(rows_above(artifacts.readers()));
    const auto after_level = [&](const RoundProgress& progress) {
      if (!journal_.due()) return;
      save_level(progress, out);
      release_levels(artifacts.readers(), *progress.level);
    };
    for (const ArtifactRoot& root : merge(artifacts.readers(), true, output, after_level)) {
      seams_.report.voxels += root.voxels;
      seams_.report.svo_nodes += root.svo_nodes;
    }
    ++seams_.report.rounds;
  }

  // Rows of the levels that are left.
  uint64_t rows_above(std::span<const ArtifactReader> readers) const {
    uint64_t rows = 0;
    for (const ArtifactReader& reader : readers)
      for (const ArtifactLevel& level : reader.levels())
        if (level.level < *progress_.level) rows += level.rows;
    return rows;
  }

  void save_level(const RoundProgress& progress, GlobalFileWriter& out) {
    out.sync();
    const auto map = progress.maps->synced_file(seams_.scratch);
    seams_.scratch.files().sync_directory(seams_.scratch.path());
    std::vector<ArtifactRef> merged;
    for (const SurveyedArtifact& artifact : artifacts_)
      if (is_round_segment(artifact.ref.segment)) merged.push_back(artifact.ref);
    MergeState state = state_of(std::move(merged));
    state.last_round = LastRoundState{
        *progress.level,       out.path(),    {out.levels().begin(), out.levels().end()},
        progress.maps->rows(), map->record(), progress.placed,
        progress.roots};
    auto named = segment_paths();
    named.push_back(map->path());
    journal_.save(level_read(*progress.level), std::move(state), std::move(named));
  }

  // Frames of the inputs' levels down from `level` are not needed any more. An artifact's levels
  // lie one after the other, the bricks first.
  void release_levels(std::span<const ArtifactReader> readers, uint32_t level) {
    released_ends_.resize(readers.size());
    for (size_t i = 0; i < readers.size(); ++i) {
      const ArtifactRef& ref = artifacts_[i].ref;
      if (is_round_segment(ref.segment)) continue;
      uint64_t end = ref.offset;
      for (const ArtifactLevel& merged : readers[i].levels())
        if (merged.level >= level && !merged.frames.empty())
          end = merged.frames.back().offset + merged.frames.back().bytes;
      const uint64_t begin = std::max(ref.offset, released_ends_[i]);
      if (end < begin + kLeastReleasedBytes) continue;
      journal_.release(ref.segment, begin, end - begin);
      released_ends_[i] = end;
    }
  }

  // The levels of the inputs that are still read end above `level`, unless a round was finished:
  // then none is.
  uint32_t level_read(uint32_t level) const {
    const auto is_input = [](const SurveyedArtifact& a) {
      return !is_round_segment(a.ref.segment);
    };
    return std::ranges::any_of(artifacts_, is_input) ? level : 0;
  }

  std::vector<std::shared_ptr<ScratchPath>> segment_paths() const {
    std::vector<std::shared_ptr<ScratchPath>> paths;
    for (const auto& [id, segment] : segments_) paths.push_back(segment->path());
    return paths;
  }

  const MergeInputs& inputs_;
  const MergeSeams& seams_;
  MergeJournal journal_;
  const OpenSegment open_;
  const uint64_t round_slab_bytes_;
  uint64_t inputs_checksum_ = 0;
  std::vector<SurveyedArtifact> artifacts_;                     // to merge next
  uint64_t rows_ = 0;                                           // of these
  uint64_t rows_before_ = 0;                                    // swept before this merge went on
  std::map<uint32_t, std::unique_ptr<RoundSegment>> segments_;  // that artifacts lie in
  RoundProgress progress_;                                      // of the last round, when restored
  bool last_round_begun_ = false;
  std::vector<uint64_t> released_ends_;  // of the space that each artifact gave back
};

}  // namespace

MergeReport merge_sub_dags(const MergeInputs& inputs, FileSystem& files, GlobalFileWriter& out,
                           MemoryBudget& budget, unsigned threads, Progress& progress,
                           const CancelToken& cancel, Checkpoint* checkpoint) {
  MergeReport report;
  if (inputs.artifacts.empty()) return report;
  MergeScratch scratch(files, inputs.scratch_folder);
  MergeProgress rows_swept(progress);
  const MergeSeams seams{scratch,    budget, MemoryPlan::divide(budget.available(), threads),
                         rows_swept, cancel, report};
  Merger(inputs, seams, checkpoint).run(out);
  report.scratch_bytes += scratch.bytes_written();
  return report;
}

}  // namespace voxdag
