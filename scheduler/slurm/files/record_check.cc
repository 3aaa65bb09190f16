#include "scheduler/slurm/files/record_check.h"

#include <algorithm>
#include <set>

#include "core/base/error.h"
#include "core/format/artifact/artifact_reader.h"
#include "core/format/artifact/segment_writer.h"
#include "core/geometry/octree_descent.h"

namespace voxdag {
namespace {

[[noreturn]] void refuse_record(const std::string& what) { throw Error(ErrorCode::kCorrupt, what); }

std::string describe(const Cube& cube) {
  return "level " + std::to_string(cube.level) + ", position (" + std::to_string(cube.position[0]) +
         ", " + std::to_string(cube.position[1]) + ", " + std::to_string(cube.position[2]) + ")";
}

// True if every triangle in a cube sets a voxel of the cube. With the rule kThin, a triangle sets
// no voxel if it crosses no axis-parallel line through voxel centers.
bool always_sets_voxels(VoxelRule rule) { return rule == VoxelRule::kShell; }

// True if all voxels of the subvolume's cube are set, and the build is a solid.
bool is_full_cube(const ClusterState& state, const Cube& cube, uint64_t voxels) {
  return state.solid != SolidRule::kNone &&
         voxels == uint64_t{1} << 3 * (state.shape.grid_levels - cube.level);
}

// Checks that the record has voxels only in subvolumes that have triangles, and in full cubes of a
// solid. Unless the rule allows triangles without voxels, also checks that every subvolume with
// triangles has voxels.
void check_counts(const CompletionRecord& record, std::span<const ExpectedSubvolume> subvolumes,
                  const ClusterState& state) {
  for (size_t i = 0; i < subvolumes.size(); ++i) {
    const auto& triangles = subvolumes[i].triangles;
    const uint64_t voxels = record.subvolumes[i].summary.voxels;
    if (!triangles || (*triangles > 0) == (voxels > 0)) continue;
    if (*triangles == 0 && is_full_cube(state, subvolumes[i].cube, voxels)) continue;
    if (*triangles == 0 || always_sets_voxels(state.rule))
      refuse_record("it has " + std::to_string(voxels) + " voxels for the " +
                    std::to_string(*triangles) + " triangles of the subvolume at " +
                    describe(subvolumes[i].cube));
  }
}

// Checks that the artifact has the roots of the cubes `to_find`, and that the voxels of its roots
// add up to the voxels in the record.
void check_roots(const ArtifactReader& artifact, const CompletionRecord& record,
                 std::span<const ExpectedSubvolume> subvolumes, std::set<Cube> to_find) {
  std::vector<uint64_t> voxels(subvolumes.size());
  for (const ArtifactRoot& root : artifact.roots()) {
    const auto owner = std::ranges::find_if(
        subvolumes, [&](const ExpectedSubvolume& s) { return contains(s.cube, root.cube); });
    if (owner == subvolumes.end())
      refuse_record("its artifact has the root of the cube at " + describe(root.cube) +
                    ": expected only cubes of the batch");
    to_find.erase(owner->cube);
    voxels[static_cast<size_t>(owner - subvolumes.begin())] += root.voxels;
  }
  if (!to_find.empty())
    refuse_record("its artifact lacks the root of the subvolume at " + describe(*to_find.begin()) +
                  ": expected the roots of all subvolumes of the batch");
  for (size_t i = 0; i < subvolumes.size(); ++i)
    if (voxels[i] != record.subvolumes[i].summary.voxels)
      refuse_record("its artifact has " + std::to_string(voxels[i]) +
                    " voxels in the subvolume at " + describe(subvolumes[i].cube) + ": expected " +
                    std::to_string(record.subvolumes[i].summary.voxels));
}

}  // namespace

CompletionRecord read_valid_record(FileSystem& files, const ClusterFolder& folder,
                                   const ClusterFolder::Entry& entry, const ClusterState& state,
                                   std::span<const ExpectedSubvolume> subvolumes) {
  const CompletionRecord record =
      decode_record(read_own_file(files, entry.path, max_record_bytes(subvolumes.size())));
  if (record.program != state.program)
    throw Error(ErrorCode::kUnsupportedVersion, "it was written by voxdag " + record.program +
                                                    " on " + record.node + ": expected voxdag " +
                                                    state.program);
  if (record.build != state.build || record.batch != entry.batch || record.attempt != entry.attempt)
    refuse_record("it belongs to build " + record.build + ", batch " +
                  std::to_string(record.batch) + ", attempt " + record.attempt + ": expected " +
                  state.build + ", " + std::to_string(entry.batch) + ", " + entry.attempt);
  if (!std::ranges::equal(record.subvolumes, subvolumes, {}, &BuiltSubvolume::id,
                          &ExpectedSubvolume::id))
    refuse_record("its list of " + std::to_string(record.subvolumes.size()) +
                  " subvolumes differs from the batch's list of " +
                  std::to_string(subvolumes.size()) + ": expected the same subvolumes");
  check_counts(record, subvolumes, state);
  std::set<Cube> to_find;
  for (size_t i = 0; i < subvolumes.size(); ++i)
    if (!record.subvolumes[i].summary.empty()) to_find.insert(subvolumes[i].cube);
  if (to_find.empty()) return record;
  if (record.artifact.segment != ClusterFolder::segment_of(record.batch))
    refuse_record("it names segment " + std::to_string(record.artifact.segment) + ": expected " +
                  std::to_string(ClusterFolder::segment_of(record.batch)));
  const std::shared_ptr<ReadableFile> segment =
      files.open_own(segment_of_record(files, folder, record));
  if (segment->size() < record.segment_bytes)
    refuse_record("its segment has " + std::to_string(segment->size()) + " bytes: expected " +
                  std::to_string(record.segment_bytes));
  const ArtifactReader artifact(segment, record.artifact);
  if (artifact.shape() != state.shape)
    refuse_record("its artifact is for " + std::to_string(artifact.shape().grid_levels) +
                  " grid levels and " + std::to_string(artifact.shape().hash_bits) +
                  " hash bits: expected " + std::to_string(state.shape.grid_levels) + " and " +
                  std::to_string(state.shape.hash_bits));
  check_roots(artifact, record, subvolumes, std::move(to_find));
  return record;
}

std::string segment_of_record(FileSystem& files, const ClusterFolder& folder,
                              const CompletionRecord& record) {
  const std::string of_attempt = segment_path(folder.attempt_folder(record.batch, record.attempt),
                                              ClusterFolder::segment_of(record.batch));
  return files.exists(of_attempt) ? of_attempt : folder.accepted_segment_path(record.batch);
}

}  // namespace voxdag
