// The subvolumes of a running build, collected from its Progress calls.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>

#include "core/base/progress.h"
#include "server/jobs/protocol/job_messages.h"

namespace voxdag::server {

class SubvolumeMap {
 public:
  void set(uint64_t resolution, std::span<const SubvolumeStatus> all);
  void set_grid(const std::array<double, 3>& origin, double edge);
  void begun(int64_t id);
  // Records that no subvolume is being built any more.
  void stop();
  void built(const SubvolumeStatus& subvolume);
  void split(int64_t id, std::span<const SubvolumeStatus> parts);

  const SubvolumeTotals& totals() const { return totals_; }
  // Returns the contents of subvolumes.json. An entry of "cubes" has the low corner and the edge of
  // a subvolume, in voxels, and 1 if it is built, else 0. "origin" and "edge" are the low corner
  // and the edge of the grid, in scene units.
  //   {"resolution": R, "built": n, "total": n, "cubes": [[x, y, z, edge, built], ...],
  //    "working": [[x, y, z, edge], ...], "origin": [x, y, z], "edge": e}
  std::string json() const;

 private:
  struct Entry {
    std::array<uint32_t, 3> corner{};
    uint32_t edge = 0;
    bool begun = false, built = false;
  };
  void add(const SubvolumeStatus& subvolume);

  uint64_t resolution_ = 0;
  std::array<double, 3> origin_{};
  double edge_ = 1;
  std::map<int64_t, Entry> entries_;  // keyed by id
  SubvolumeTotals totals_;
};

}  // namespace voxdag::server
