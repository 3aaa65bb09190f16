#include "scheduler/execute/damage.h"

#include <map>

#include "core/format/artifact/artifact_reader.h"

namespace voxdag {
namespace {

void read_above(uint32_t level, std::shared_ptr<ReadableFile> segment,
                const StoredSubvolume& subvolume) {
  const ArtifactReader reader(std::move(segment), subvolume.artifact);
  const auto roots = reader.roots();
  if (roots.size() != 1 || !(roots[0].cube == subvolume.cube))
    throw Error(ErrorCode::kCorrupt, "the artifact is that of another cube");
  Frame frame;
  for (const ArtifactLevel& l : reader.levels())
    for (size_t i = 0; l.level < level && i < l.frames.size(); ++i)
      reader.read_frame(l.level, i, frame);
}

}  // namespace

std::vector<DamagedSubvolume> find_damaged(
    std::span<const StoredSubvolume> subvolumes, uint32_t level,
    const std::function<std::shared_ptr<ReadableFile>(uint32_t)>& open_segment,
    const CancelToken& cancel) {
  std::vector<DamagedSubvolume> damaged;
  std::map<uint32_t, std::shared_ptr<ReadableFile>> segments;
  for (const StoredSubvolume& subvolume : subvolumes) {
    if (subvolume.state != SubvolumeState::kBuilt || subvolume.summary.empty()) continue;
    cancel.check();
    try {
      auto& segment = segments[subvolume.artifact.segment];
      if (!segment) segment = open_segment(subvolume.artifact.segment);
      read_above(level, segment, subvolume);
    } catch (const Error& error) {
      if (!error.is_corruption()) throw;
      damaged.push_back({subvolume, error.message()});
    }
  }
  return damaged;
}

}  // namespace voxdag
