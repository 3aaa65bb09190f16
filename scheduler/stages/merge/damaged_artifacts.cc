#include "scheduler/stages/merge/damaged_artifacts.h"

#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/format/artifact/artifact_reader.h"
#include "core/geometry/octree_descent.h"

namespace voxdag {
namespace {

// Maximum number of damaged subvolumes named in warnings. Further ones are only counted.
constexpr size_t kMaxWarnings = 5;

struct DamagedSubvolume {
  StoredSubvolume subvolume;
  std::string defect;
};

// Checks the artifact's roots and, if `reads_frames`, reads its levels above `level`.
void read_above(uint32_t level, std::shared_ptr<ReadableFile> segment,
                const StoredSubvolume& subvolume, bool reads_frames) {
  const ArtifactReader reader(std::move(segment), subvolume.artifact);
  // If a cluster task has split the subvolume, it has merged the parts with the other subvolumes of
  // its batch. Then the artifact has a root for each part and each other subvolume.
  if (std::ranges::none_of(reader.roots(), [&](const ArtifactRoot& root) {
        return contains(subvolume.cube, root.cube);
      }))
    throw Error(ErrorCode::kCorrupt,
                "the artifact has no root in the subvolume's cube: expected at least one");
  if (!reads_frames) return;
  Frame frame;
  for (const ArtifactLevel& l : reader.levels())
    for (size_t i = 0; l.level < level && i < l.frames.size(); ++i)
      reader.read_frame(l.level, i, frame);
}

// Reads the artifacts of all built subvolumes and returns the damaged ones. Reads only levels above
// `level` (with smaller numbers), because the merge releases deeper levels while it runs.
std::vector<DamagedSubvolume> find_damaged(std::span<const StoredSubvolume> subvolumes,
                                           uint32_t level, const WorkFolder& work,
                                           const CancelToken& cancel) {
  std::vector<DamagedSubvolume> damaged;
  std::map<uint32_t, std::shared_ptr<ReadableFile>> segments;
  std::set<std::pair<uint32_t, uint64_t>> sound;  // intact artifacts, by segment and offset
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

size_t replan_damaged(BuildJob& job) {
  job.commits.commit();
  const auto merge = job.store->merge();
  const auto damaged = find_damaged(job.store->leaves(), merge ? merge->level : UINT32_MAX,
                                    job.work, job.context.cancel);
  size_t warnings = 0;
  for (const DamagedSubvolume& d : damaged) {
    if (++warnings <= kMaxWarnings)
      job.context.progress.warn("subvolume " + std::to_string(d.subvolume.id) +
                                " is built again: " + d.defect);
    job.store->mark_for_rebuild(d.subvolume);
  }
  if (warnings > kMaxWarnings)
    job.context.progress.warn(std::to_string(warnings - kMaxWarnings) +
                              " more subvolumes are built again: their artifacts are damaged");
  return damaged.size();
}

}  // namespace voxdag
