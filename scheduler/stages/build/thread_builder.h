// Builds subvolumes on the threads of this process, one subvolume per thread.
#pragma once

#include <span>
#include <string>

#include "scheduler/stages/build/subvolume_builder.h"
#include "scheduler/stages/rows/rows_stage.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

class ThreadBuilder : public SubvolumeBuilder {
 public:
  explicit ThreadBuilder(BuildJob& job) : job_(job) {}

  void resume(const std::string&) override {}
  void build(PreparedScene& scene, std::span<const StoredSubvolume> planned) override;
  void add_to(BuildReport&) const override {}

 private:
  // Computes the rows of a solid before its first subvolume is built.
  void prepare_rows(std::span<const PlannedCube> planned, const TriangleStore& triangles);

  BuildJob& job_;
};

}  // namespace voxdag
