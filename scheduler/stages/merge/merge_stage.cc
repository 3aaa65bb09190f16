#include "scheduler/stages/merge/merge_stage.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "core/base/error.h"
#include "core/format/artifact/artifact_reader.h"
#include "core/format/checksum.h"
#include "core/geometry/octree_descent.h"
#include "merge/merge.h"
#include "scheduler/triangles/triangle_file.h"

namespace voxdag {
namespace {

// Damaged subvolumes that are named; of more only the number is.
constexpr size_t kMaxWarnings = 5;

// Stores a merge's state in the job store.
class StoredCheckpoint : public Checkpoint {
 public:
  StoredCheckpoint(JobStore& store, CommitQueues& commits, WorkFolder& work)
      : store_(store), commits_(commits), work_(work) {}
  std::optional<std::vector<std::byte>> load() override {
    auto stored = store_.merge();
    if (!stored) return std::nullopt;
    return std::move(stored->state);
  }
  void save(uint32_t level, std::span<const std::byte> state) override {
    commits_.commit();
    store_.save_merge(level, state);
  }
  void forget() override { store_.forget_merge(); }
  void release(const SegmentRange& range) override { work_.release(range); }

 private:
  JobStore& store_;
  CommitQueues& commits_;
  WorkFolder& work_;
};

struct DamagedSubvolume {
  StoredSubvolume subvolume;
  std::string what;  // what is wrong with its artifact
};

// Reads the frames only if `reads_frames`.
void read_above(uint32_t level, std::shared_ptr<ReadableFile> segment,
                const StoredSubvolume& subvolume, bool reads_frames) {
  const ArtifactReader reader(std::move(segment), subvolume.artifact);
  // A cluster's task may have split the subvolume, and merged it with others.
  if (std::ranges::none_of(reader.roots(), [&](const ArtifactRoot& root) {
        return contains(subvolume.cube, root.cube);
      }))
    throw Error(ErrorCode::kCorrupt, "the artifact is that of another cube");
  if (!reads_frames) return;
  Frame frame;
  for (const ArtifactLevel& l : reader.levels())
    for (size_t i = 0; l.level < level && i < l.frames.size(); ++i)
      reader.read_frame(l.level, i, frame);
}

// Reads the artifacts of all built subvolumes, the levels above `level` (of smaller number): the
// others are not needed any more and may be gone.
std::vector<DamagedSubvolume> find_damaged(std::span<const StoredSubvolume> subvolumes,
                                           uint32_t level, const WorkFolder& work,
                                           const CancelToken& cancel) {
  std::vector<DamagedSubvolume> damaged;
  std::map<uint32_t, std::shared_ptr<ReadableFile>> segments;
  std::set<std::pair<uint32_t, uint64_t>> sound;  // artifacts, by their places
  for (const StoredSubvolume& subvolume : subvolumes) {
    if (subvolume.state != SubvolumeState::kBuilt || subvolume.summary.empty()) continue;
    cancel.check();
    try {
      auto& segment = segments[subvolume.artifact.segment];
      if (!segment) segment = work.open_segment(subvolume.artifact.segment);
      const std::pair place(subvolume.artifact.segment, subvolume.artifact.offset);
      read_above(level, segment, subvolume, !sound.contains(place));
      sound.insert(place);
    } catch (const Error& error) {
      if (!error.is_corruption()) throw;
      damaged.push_back({subvolume, error.message()});
    }
  }
  return damaged;
}

}  // namespace

std::vector<ArtifactRef> distinct_artifacts(std::span<const StoredSubvolume> subvolumes) {
  std::vector<ArtifactRef> artifacts;
  std::map<std::pair<uint32_t, uint64_t>, ArtifactRef> seen;
  for (const StoredSubvolume& subvolume : subvolumes) {
    if (subvolume.summary.empty()) continue;
    const ArtifactRef& artifact = subvolume.artifact;
    const auto [first, is_new] = seen.try_emplace({artifact.segment, artifact.offset}, artifact);
    if (is_new)
      artifacts.push_back(artifact);
    else if (first->second != artifact)
      throw Error(ErrorCode::kCorrupt, "job.db: two artifacts lie at byte " +
                                           std::to_string(artifact.offset) + " of segment " +
                                           std::to_string(artifact.segment));
  }
  return artifacts;
}

bool MergeStage::run(const RunOptions& options, const Sections& sections, BuildReport& report) {
  if (is_published(sections, report)) return true;
  bool reads_scene = false;  // what is missing or broken in it is no damage of the work folder
  try {
    GlobalFileWriter out(context_.files, report.output, report.grid, report.hash_bits);
    merge(options, out, report);
    reads_scene = true;
    sections.add(out);
    reads_scene = false;
    write(out, sections, report);
    return true;
  } catch (const Error& error) {
    // The scratch of the colors is made again, too.
    const bool is_scratch = dynamic_cast<const DamagedTriangles*>(&error) != nullptr;
    if ((reads_scene && !is_scratch) || !error.is_corruption() || !heal(error)) throw;
    return false;
  }
}

// An earlier run may have been stopped after the file got its name.
bool MergeStage::is_published(const Sections& sections, BuildReport& report) {
  const auto result = store_.result();
  if (!result || result->output != report.output || !context_.files.exists(report.output) ||
      sha256_of_file(*context_.files.open_read(report.output), context_.cancel) != result->sha256 ||
      sections.digest() != result->sections)
    return false;
  report.sha256 = result->sha256;
  report.bytes = result->bytes;
  report.merge = result->merge;
  return true;
}

void MergeStage::merge(const RunOptions& options, GlobalFileWriter& out, BuildReport& report) {
  MergeInputs inputs;
  inputs.shape = {.grid_levels = report.grid.levels, .hash_bits = report.hash_bits};
  inputs.artifacts = distinct_artifacts(store_.leaves());
  const MemoryCharge list(budget_, inputs.artifacts.size() * sizeof(ArtifactRef),
                          "the list of artifacts");
  inputs.open_segment = [&](uint32_t id) { return work_.open_segment(id); };
  inputs.scratch_folder = work_.scratch_path();
  inputs.checkpoint_interval_s = options.checkpoint_interval_s;
  StoredCheckpoint checkpoint(store_, commits_, work_);
  report.merge = merge_sub_dags(inputs, context_.files, out, budget_, report.threads,
                                context_.progress, context_.cancel, &checkpoint);
  report.spill_bytes += report.merge.scratch_bytes;
  if (report.merge.voxels == 0 && report.triangles > 0)
    context_.progress.warn("none of the " + std::to_string(report.triangles) +
                           " triangles near the grid touches it: the file will have no nodes");
  clock_.finish("merge");
}

void MergeStage::write(GlobalFileWriter& out, const Sections& sections, BuildReport& report) {
  context_.progress.begin_stage("write", 1, "files");
  const GlobalFileSummary file =
      out.seal({.voxels = report.merge.voxels, .svo_nodes = report.merge.svo_nodes}, report.threads,
               context_.cancel);
  store_.record_result({report.output, file.sha256, file.bytes, report.merge, sections.digest()});
  out.publish();
  context_.progress.advance(1);
  context_.progress.end_stage();
  report.bytes = file.bytes;
  report.sha256 = file.sha256;
  clock_.finish("write");
}

// Plans damaged subvolumes again. If none is damaged, a file of the merge must be: it restarts,
// once.
bool MergeStage::heal(const Error& error) {
  commits_.commit();
  const auto merge = store_.merge();
  const auto damaged =
      find_damaged(store_.leaves(), merge ? merge->level : UINT32_MAX, work_, context_.cancel);
  size_t warnings = 0;
  for (const DamagedSubvolume& d : damaged) {
    if (++warnings <= kMaxWarnings)
      context_.progress.warn("subvolume " + std::to_string(d.subvolume.id) +
                             " is built again: " + d.what);
    store_.mark_for_rebuild(d.subvolume);
  }
  if (warnings > kMaxWarnings)
    context_.progress.warn("... and so are " + std::to_string(warnings - kMaxWarnings) + " more");
  if (!damaged.empty()) return true;
  if (restarted_) return false;
  restarted_ = true;
  store_.forget_merge();
  context_.progress.warn("the merge restarts: " + error.message());
  return true;
}

}  // namespace voxdag
