#include "merge/load/level_run.h"

#include <algorithm>

namespace voxdag {

FrameSpan LevelRun::frames_within(const HashInterval& interval) const {
  const auto first_hash = [](const FrameInfo& frame) { return frame.first_hash; };
  const auto begin = std::ranges::lower_bound(frames_, interval.first, {}, first_hash);
  const auto end = std::ranges::upper_bound(frames_, interval.last, {}, first_hash);
  // The frame before `begin` starts before the interval, but can extend into it.
  const auto reaching = begin == frames_.begin() ? begin : begin - 1;
  return {static_cast<size_t>(reaching - frames_.begin()),
          static_cast<size_t>(std::max(reaching, end) - frames_.begin())};
}

ArtifactRun::ArtifactRun(const ArtifactReader& artifact, uint32_t level, bool wide)
    : LevelRun({level == artifact.shape().brick_level(), wide}, false),
      artifact_(artifact),
      level_(level) {
  if (const ArtifactLevel* rows = artifact.level(level))
    set_frames(rows->frames, rows->rows, rows->children);
}

}  // namespace voxdag
