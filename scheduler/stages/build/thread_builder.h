// Builds subvolumes on the threads of this process, one subvolume per thread.
#pragma once

#include <span>
#include <string>

#include "scheduler/stages/build/subvolume_builder.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

class ThreadBuilder : public SubvolumeBuilder {
 public:
  explicit ThreadBuilder(BuildJob& job) : job_(job) {}

  void resume(const std::string&) override {}
  void build(PreparedScene& scene, std::span<const StoredSubvolume> planned) override;
  void add_to(BuildReport&) const override {}

 private:
  BuildJob& job_;
};

}  // namespace voxdag
