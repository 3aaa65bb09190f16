#include "server/tiles/partial/coarse_cubes.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/popcount8.h"
#include "core/dag/brick.h"
#include "core/format/artifact/artifact_reader.h"
#include "core/format/artifact/segment_writer.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {
namespace {

// Reads the rows of one artifact, which are its nodes and bricks. Keeps one frame (a group of
// consecutive rows, artifact.h) of each level in memory.
class ArtifactRows {
 public:
  ArtifactRows(std::shared_ptr<ReadableFile> segment, const ArtifactRef& ref)
      : ref_(ref), reader_(std::move(segment), ref) {}

  const ArtifactRef& ref() const { return ref_; }

  // Returns the occupied cells of the cube as a brick. A cell has a quarter of the cube's edge.
  // Throws Error{kCorrupt} if the artifact is damaged or does not contain the cube.
  uint64_t coarse_brick(const Cube& cube) {
    const auto roots = reader_.roots();
    const auto root = std::find_if(roots.begin(), roots.end(),
                                   [&](const ArtifactRoot& r) { return r.cube == cube; });
    if (root == roots.end())
      throw Error(ErrorCode::kCorrupt, reader_.place() + ": no root is the subvolume of level " +
                                           std::to_string(cube.level) + " at " +
                                           std::to_string(cube.position[0]) + " " +
                                           std::to_string(cube.position[1]) + " " +
                                           std::to_string(cube.position[2]) + ", expected one");
    const uint32_t bricks = reader_.shape().brick_level();
    if (cube.level == bricks) return brick(root->index);
    const Frame& frame = frame_of(cube.level, root->index);
    const size_t row = root->index % kFrameRows;
    size_t child = 0;
    for (size_t r = 0; r < row; ++r) child += static_cast<size_t>(popcount8(frame.masks[r]));
    const uint32_t mask = frame.masks[row];
    uint64_t coarse = 0;
    for (int i = 0; i < 8; ++i)
      if (mask >> i & 1)
        coarse |= uint64_t{children_of(cube.level + 1, frame.children[child++])} << (8 * i);
    return coarse;
  }

 private:
  struct Held {
    Frame frame;
    std::optional<size_t> index;
  };

  const Frame& frame_of(uint32_t level, uint32_t row) {
    const ArtifactLevel* const info = reader_.level(level);
    if (!info || row >= info->rows)
      throw Error(ErrorCode::kCorrupt,
                  reader_.place() + ": it has " + std::to_string(info ? info->rows : 0) +
                      " rows in its level " + std::to_string(level) + ": expected row " +
                      std::to_string(row) + ", to which a node or the root refers");
    Held& held = held_[level];
    if (held.index != row / kFrameRows) {
      held.index.reset();
      reader_.read_frame(level, row / kFrameRows, held.frame);
      held.index = row / kFrameRows;
    }
    return held.frame;
  }
  uint64_t brick(uint32_t row) {
    return frame_of(reader_.shape().brick_level(), row).brick_masks[row % kFrameRows];
  }
  // Returns the child mask of a node, or the occupied octants of a brick.
  uint32_t children_of(uint32_t level, uint32_t row) {
    if (level < reader_.shape().brick_level()) return frame_of(level, row).masks[row % kFrameRows];
    return octants(brick(row));
  }

  const ArtifactRef ref_;
  const ArtifactReader reader_;
  std::map<uint32_t, Held> held_;  // by level
};

}  // namespace

void CoarseCubes::refresh(FileSystem& files, const std::string& work_folder, double max_read_s) {
  const std::string store_path = WorkFolder::store_path(work_folder);
  if (!files.exists(store_path))
    throw Error(ErrorCode::kNotFound,
                work_folder + " has no job.db: expected the work folder of a job that has started");
  std::vector<StoredSubvolume> leaves = JobStore(store_path, JobStore::Access::kRead).leaves();
  total_ = leaves.size();
  std::erase_if(leaves, [](const StoredSubvolume& s) { return s.state != SubvolumeState::kBuilt; });
  built_ = leaves.size();
  std::map<SubvolumeId, CoarseCube> cubes;
  std::erase_if(leaves, [&](const StoredSubvolume& leaf) {
    if (leaf.summary.empty()) return true;
    // Keeps a known cube only if it was read from the same artifact, because a restarted job may
    // have built different cells under the same id.
    const auto known = cubes_.find(leaf.id);
    if (known == cubes_.end() || known->second.cube != leaf.cube ||
        known->second.artifact != leaf.artifact)
      return false;
    cubes.insert(*known);
    return true;
  });
  // Every call retries unreadable artifacts, which may use up the call's time. So each call begins
  // where the last call stopped, and later calls reach the remaining artifacts.
  std::rotate(leaves.begin(),
              std::find_if(leaves.begin(), leaves.end(),
                           [&](const StoredSubvolume& leaf) { return leaf.id >= next_; }),
              leaves.end());
  const double end_s = wall_seconds() + max_read_s;
  std::unique_ptr<ArtifactRows> rows;
  for (const StoredSubvolume& leaf : leaves) {
    next_ = leaf.id;
    if (&leaf != &leaves[0] && wall_seconds() > end_s) break;
    try {
      if (!rows || rows->ref() != leaf.artifact)
        rows = std::make_unique<ArtifactRows>(
            files.open_own(segment_path(work_folder, leaf.artifact.segment)), leaf.artifact);
      cubes[leaf.id] = {leaf.cube, rows->coarse_brick(leaf.cube), leaf.artifact};
    } catch (const Error&) {
      rows.reset();
    }
  }
  cubes_ = std::move(cubes);
}

void CoarseCubes::show_plan(uint64_t total) {
  *this = {};
  total_ = total;
}

}  // namespace voxdag
