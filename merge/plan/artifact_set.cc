#include "merge/plan/artifact_set.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "core/geometry/morton.h"
#include "merge/load/hash_partition.h"
#include "merge/load/level_run.h"

namespace voxdag {
namespace {

// Opens artifacts, each segment file once.
class Opener {
 public:
  Opener(const OpenSegment& open, const DagShape& shape) : open_(open), shape_(shape) {}

  ArtifactReader open(const ArtifactRef& ref) {
    std::shared_ptr<ReadableFile>& file = files_[ref.segment];
    if (!file) file = open_(ref.segment);
    ArtifactReader reader(file, ref);
    check(reader, file->path() + ", artifact at byte " + std::to_string(ref.offset) + ": ");
    return reader;
  }

 private:
  void check(const ArtifactReader& reader, const std::string& where) const {
    if (reader.shape() != shape_)
      throw Error(ErrorCode::kCorrupt,
                  where + "made for " + std::to_string(reader.shape().grid_levels) +
                      " grid levels and " + std::to_string(reader.shape().hash_bits) +
                      " hash bits, expected " + std::to_string(shape_.grid_levels) + " and " +
                      std::to_string(shape_.hash_bits));
    if (reader.roots().empty())
      throw Error(ErrorCode::kCorrupt, where + "has no root, expected at least one");
    for (const ArtifactRoot& root : reader.roots()) {
      const ArtifactLevel* const level = reader.level(root.cube.level);
      if (!level || root.index >= level->rows)
        throw Error(ErrorCode::kCorrupt, where + "the root on level " +
                                             std::to_string(root.cube.level) + " is row " +
                                             std::to_string(root.index) + ", expected less than " +
                                             std::to_string(level ? level->rows : 0) +
                                             ", the number of rows of this level");
    }
  }

  const OpenSegment& open_;
  const DagShape shape_;
  std::map<uint32_t, std::shared_ptr<ReadableFile>> files_;
};

uint64_t index_bytes(const ArtifactReader& reader) {
  uint64_t bytes = sizeof(ArtifactReader) + reader.roots().size_bytes();
  for (const ArtifactLevel& level : reader.levels())
    bytes += sizeof(level) + level.frames.size() * sizeof(FrameInfo);
  return bytes;
}

uint64_t row_count(const ArtifactReader& reader) {
  uint64_t rows = 0;
  for (const ArtifactLevel& level : reader.levels()) rows += level.rows;
  return rows;
}

uint64_t content_checksum(const ArtifactReader& reader) {
  std::vector<uint64_t> words;
  for (const ArtifactRoot& root : reader.roots()) {
    words.insert(words.end(),
                 {root.cube.level, root.cube.position[0], root.cube.position[1],
                  root.cube.position[2], root.index, root.hash, root.voxels, root.svo_nodes});
  }
  for (const ArtifactLevel& level : reader.levels())
    words.insert(words.end(), {level.level, level.rows, level.children});
  return checksum64(std::as_bytes(std::span(words)));
}

// Returns the memory that a hash partition needs to hold any two neighboring frames.
uint64_t min_partition_bytes(const ArtifactReader& reader, bool wide) {
  uint64_t max = 0;
  for (const ArtifactLevel& level : reader.levels()) {
    const ArtifactRun run(reader, level.level, wide);
    for (size_t begin = 0; begin < level.frames.size(); ++begin) {
      const size_t end = std::min(begin + 2, level.frames.size());
      max = std::max(max, HashPartition::bytes_for(run.count({begin, end}), wide ? 2 : 1));
    }
  }
  return max;
}

// Lower limit of SurveyedArtifact::min_bytes, so that the budget also limits the number of open
// runs.
constexpr uint64_t kMinRunBytes = uint64_t{64} << 10;

// Returns the Morton code of the cube's low corner. The unit is a cube of level kMaxGridLevels, so
// that the codes of cubes of different levels are comparable.
uint64_t morton_code_of(const Cube& cube) {
  const uint64_t code = morton_encode(cube.position[0], cube.position[1], cube.position[2]);
  return code << 3 * (kMaxGridLevels - cube.level);
}

}  // namespace

ArtifactSet::ArtifactSet(std::span<const SurveyedArtifact> artifacts, const OpenSegment& open,
                         const DagShape& shape, MemoryBudget& budget) {
  Opener opener(open, shape);
  uint64_t bytes = 0;
  for (const SurveyedArtifact& artifact : artifacts) {
    readers_.push_back(opener.open(artifact.ref));
    bytes += index_bytes(readers_.back());
  }
  charge_ = MemoryCharge(budget, bytes, "the artifacts' indexes");
}

ArtifactSurvey survey_artifacts(std::span<const ArtifactRef> refs, const OpenSegment& open,
                                const DagShape& shape, bool wide) {
  Opener opener(open, shape);
  ArtifactSurvey survey;
  std::vector<std::pair<uint64_t, SurveyedArtifact>> by_code;
  for (const ArtifactRef& ref : refs) {
    const ArtifactReader reader = opener.open(ref);
    SurveyedArtifact found{
        ref,
        std::max(kMinRunBytes, index_bytes(reader) + min_partition_bytes(reader, wide)),
        row_count(reader),
        content_checksum(reader),
        {}};
    survey.rows += found.rows;
    for (const ArtifactRoot& root : reader.roots()) found.cubes.push_back(root.cube);
    by_code.emplace_back(morton_code_of(found.cubes[0]), std::move(found));
  }
  std::ranges::stable_sort(by_code, {}, &std::pair<uint64_t, SurveyedArtifact>::first);
  for (auto& [code, artifact] : by_code) survey.in_morton_order.push_back(std::move(artifact));
  return survey;
}

}  // namespace voxdag
