// A coarse view of an unfinished build: its built subvolumes with the occupied cells of a quarter
// of their edge, read from the work folder at any time, even while another process builds there.
// Not thread-safe.
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
  // 4x4x4 cells, bits as the voxels of a brick (docs/format.md); voxels, for a cube of edge 4.
  uint64_t brick = 0;
  ArtifactRef artifact;  // from which it was read
};

class CoarseCubes {
 public:
  // Looks at the folder again, and reads the artifacts that are new since the last time. One that
  // cannot be read is left out: it may be merged already and its bytes freed. After `max_read_s`
  // the rest is left for the next times, but for one. Throws Error{kNotFound} if the folder has no
  // job store, and as JobStore does.
  void refresh(FileSystem& files, const std::string& work_folder, double max_read_s = HUGE_VAL);

  uint64_t total() const { return total_; }
  // Number of built subvolumes, including empty and omitted ones.
  uint64_t built() const { return built_; }
  // Known subvolumes with voxels.
  const std::map<SubvolumeId, CoarseCube>& cubes() const { return cubes_; }

 private:
  uint64_t total_ = 0, built_ = 0;
  std::map<SubvolumeId, CoarseCube> cubes_;
  SubvolumeId next_ = 0;  // that is read first
};

}  // namespace voxdag
