#include "scheduler/stages/merge/merge_stage.h"

#include <map>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/io/buffered/small_file.h"
#include "merge/merge.h"
#include "scheduler/solid/full_cubes.h"
#include "scheduler/state/job/empty_scene.h"

namespace voxdag {
namespace {

// Artifacts of at most this total size are merged from memory.
constexpr uint64_t kSmallMergeBytes = uint64_t{4} << 20;

// Stores a merge's state in the job store.
class StoredCheckpoint : public Checkpoint {
 public:
  explicit StoredCheckpoint(BuildJob& job) : job_(job) {}
  std::optional<std::vector<std::byte>> load() override {
    auto stored = job_.store->merge();
    if (!stored) return std::nullopt;
    return std::move(stored->state);
  }
  void save(uint32_t level, std::span<const std::byte> state) override {
    job_.commits.commit();
    if (job_.filled) job_.filled->save();
    job_.store->save_merge(level, state);
  }
  void forget() override { job_.store->forget_merge(); }
  void release(const SegmentRange& range) override { job_.work.release(range); }

 private:
  BuildJob& job_;
};

// Writes an artifact of the solid's full cubes (SolidRows::full_cubes). No row of the job store
// names it: a resumed merge writes it again.
ArtifactRef write_full_cubes(BuildJob& job) {
  SegmentWriter segment(job.context.files, job.work.path(), job.work.next_segment_id(), job.budget);
  std::vector<Cube> cubes;
  for (const FullCube& full : job.rows->full_cubes) cubes.push_back(full.cube);
  const ArtifactRef artifact = add_full_cubes(segment, job.shape(), cubes);
  segment.sync();
  return artifact;
}

}  // namespace

std::vector<ArtifactRef> distinct_artifacts(std::span<const StoredSubvolume> subvolumes,
                                            const std::string& store_path) {
  std::vector<ArtifactRef> artifacts;
  std::map<std::pair<uint32_t, uint64_t>, ArtifactRef> seen;
  for (const StoredSubvolume& subvolume : subvolumes) {
    if (subvolume.summary.empty()) continue;
    const ArtifactRef& artifact = subvolume.artifact;
    const auto [first, is_new] = seen.try_emplace({artifact.segment, artifact.offset}, artifact);
    if (is_new)
      artifacts.push_back(artifact);
    else if (first->second != artifact)
      throw Error(ErrorCode::kCorrupt, store_path + ": it lists two different artifacts at byte " +
                                           std::to_string(artifact.offset) + " of segment " +
                                           std::to_string(artifact.segment) + ": expected one");
  }
  return artifacts;
}

namespace {

// Handles a scene whose triangles set no voxel: throws Error{kInvalidInput}, or only warns if the
// build has --allow-empty.
void check_voxels(const BuildJob& job) {
  const GeometryOptions& geometry = job.spec.geometry;
  std::string message = "none of the " + std::to_string(job.report.triangles) +
                        " triangles near the grid sets a voxel";
  if (geometry.thin)
    message += ", because " + option_text("thin") + " leaves out triangles between the rows";
  if (geometry.cutouts == CutoutRule::kSkip)
    message +=
        ", because " + option_text("cutouts", "skip") + " leaves out surfaces that alpha hides";
  const std::string& scene = geometry.scenes.front();
  if (!job.spec.run.allow_empty) throw empty_scene_error(scene + ": " + message);
  job.context.progress.warn_of_input(
      {"no-voxels", scene, message + "; the file will have no nodes"});
}

}  // namespace

void merge_artifacts(BuildJob& job, GlobalFileWriter& out) {
  BuildReport& report = job.report;
  MergeInputs inputs;
  inputs.shape = job.shape();
  inputs.artifacts = job.filled ? job.filled->artifacts()
                                : distinct_artifacts(job.store->leaves(), job.work.store_path());
  if (job.has_rows() && !job.rows->full_cubes.empty())
    inputs.artifacts.push_back(write_full_cubes(job));
  const MemoryCharge list(job.budget, inputs.artifacts.size() * sizeof(ArtifactRef),
                          "the list of artifacts");
  uint64_t bytes = 0;
  for (const ArtifactRef& artifact : inputs.artifacts) bytes += artifact.bytes;
  const bool is_small = bytes <= kSmallMergeBytes;
  SmallFiles small_files(kSmallMergeBytes, job.budget);
  std::map<uint32_t, std::shared_ptr<ReadableFile>> small_segments;  // each is read once
  inputs.open_segment = [&, is_small](uint32_t id) -> std::shared_ptr<ReadableFile> {
    if (!is_small) return job.work.open_segment(id);
    std::shared_ptr<ReadableFile>& segment = small_segments[id];
    if (!segment) segment = small_files.read(job.work.open_segment(id));
    return segment;
  };
  inputs.scratch_folder = job.work.scratch_path();
  inputs.checkpoint_interval_s = job.spec.run.checkpoint_interval_s;
  StoredCheckpoint checkpoint(job);
  report.merge = merge_sub_dags(inputs, job.context.files, out, job.budget, report.threads,
                                job.context.progress, job.context.cancel, &checkpoint);
  report.spill_bytes += report.merge.scratch_bytes;
  if (report.merge.voxels == 0 && report.triangles > 0) check_voxels(job);
  job.clock.finish("merge");
}

}  // namespace voxdag
