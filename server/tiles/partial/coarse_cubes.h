// A coarse view of an unfinished build: each built subvolume with its occupied cells of a quarter
// of its edge. It is read from the work folder and can be updated at any time, even while another
// process builds there. Not thread-safe.
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
  // 4x4x4 cells, with bits in the order of a brick's voxels (docs/format.md). For a cube of edge 4
  // the cells are voxels.
  uint64_t brick = 0;
  ArtifactRef artifact;  // the artifact that it was read from
};

class CoarseCubes {
 public:
  // Reads the folder again, and reads new artifacts. An unreadable artifact is left out, because
  // the merge may have freed its bytes. After `max_read_s`, and after at least one artifact, the
  // remaining artifacts are left for the next calls. Throws Error{kNotFound} if the folder has no
  // job store, and the errors of JobStore.
  void refresh(FileSystem& files, const std::string& work_folder, double max_read_s = HUGE_VAL);

  uint64_t total() const { return total_; }
  // Number of built subvolumes, including empty and omitted ones.
  uint64_t built() const { return built_; }
  // Known subvolumes with voxels.
  const std::map<SubvolumeId, CoarseCube>& cubes() const { return cubes_; }

 private:
  uint64_t total_ = 0, built_ = 0;
  std::map<SubvolumeId, CoarseCube> cubes_;
  SubvolumeId next_ = 0;  // subvolume to read first
};

}  // namespace voxdag
