// The subvolumes of a running build, put together from what its Progress reports.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>

#include "core/base/progress.h"
#include "server/jobs/process/job_messages.h"

namespace voxdag::server {

class SubvolumeMap {
 public:
  void set(uint64_t resolution, std::span<const SubvolumeStatus> all);
  void built(const SubvolumeStatus& subvolume);
  void split(int64_t id, std::span<const SubvolumeStatus> parts);

  const SubvolumeTotals& totals() const { return totals_; }
  // {"resolution": R, "built": n, "total": n, "cubes": [[x, y, z, edge, built], ...]}
  std::string json() const;

 private:
  struct Entry {
    std::array<uint32_t, 3> corner{};
    uint32_t edge = 0;
    bool built = false;
  };
  void add(const SubvolumeStatus& subvolume);

  uint64_t resolution_ = 0;
  std::map<int64_t, Entry> entries_;  // by id
  SubvolumeTotals totals_;
};

}  // namespace voxdag::server
