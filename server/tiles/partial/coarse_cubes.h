// A coarse view of an unfinished build: each built subvolume with its occupied cells, which have a
// quarter of the subvolume's edge. The view is read from the work folder, even while another
// process builds in that folder. Not thread-safe.
#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <string>

#include "core/geometry/cube.h"
#include "core/io/file_system.h"
#include "scheduler/state/job_store.h"

namespace voxdag {

struct CoarseCube {
  Cube cube;
  // 4x4x4 cells, with bits in the order of a brick's voxels (docs/format.md). In a cube with an
  // edge of 4 voxels, the cells are the voxels.
  uint64_t brick = 0;
  ArtifactRef artifact;  // the artifact that `brick` was read from
};

class CoarseCubes {
 public:
  // Reads the job store again, and the artifacts of the subvolumes that were built since the last
  // call. Leaves out an unreadable artifact, because the merge may have freed its bytes. Reads at
  // least one artifact; after `max_read_s` seconds it leaves the remaining artifacts to the next
  // calls. Throws Error{kNotFound} if the folder has no job store, and the errors of JobStore.
  void refresh(FileSystem& files, const std::string& work_folder, double max_read_s = HUGE_VAL);

  // Forgets all built subvolumes of a build with `total` planned subvolumes that has not recorded
  // its progress yet.
  void show_plan(uint64_t total);

  uint64_t total() const { return total_; }
  // Number of built subvolumes, including empty subvolumes and subvolumes with unreadable
  // artifacts.
  uint64_t built() const { return built_; }
  // Returns the known subvolumes that have voxels.
  const std::map<SubvolumeId, CoarseCube>& cubes() const { return cubes_; }

 private:
  uint64_t total_ = 0, built_ = 0;
  std::map<SubvolumeId, CoarseCube> cubes_;
  SubvolumeId next_ = 0;  // id at which the next refresh() begins to read
};

}  // namespace voxdag
