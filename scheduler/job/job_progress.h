// Passes a build's progress on, and writes it to the job store about once per second, so that
// `voxdag status` can look on from another process. Thread-safe.
#pragma once

#include <mutex>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "scheduler/job/job_store.h"
#include "scheduler/job/work_folder.h"

namespace voxdag {

class JobProgress : public Progress {
 public:
  JobProgress(Progress& shown, JobStore& store, const WorkFolder& work)
      : shown_(shown), store_(&store), work_(work) {}

  void begin_stage(std::string_view stage, uint64_t total, std::string_view unit) override;
  void advance(uint64_t count) override;
  void set_total(uint64_t total) override;
  void end_stage() override;
  void warn(std::string_view message) override { shown_.warn(message); }
  void set_subvolumes(uint64_t resolution, std::span<const SubvolumeStatus> all) override {
    shown_.set_subvolumes(resolution, all);
  }
  void subvolume_built(const SubvolumeStatus& built) override { shown_.subvolume_built(built); }
  void subvolume_split(int64_t id, std::span<const SubvolumeStatus> parts) override {
    shown_.subvolume_split(id, parts);
  }
  void record_failure(const Error& error);
  // The store is about to close: only passes on from here.
  void detach();

 private:
  // Writes the snapshot if there is a job to write it for and enough time went by.
  void record(bool at_once);

  Progress& shown_;
  std::mutex mutex_;  // guards all below
  JobStore* store_;
  const WorkFolder& work_;
  ProgressSnapshot snapshot_;
  double last_recorded_s_ = 0;
};

// A subvolume as Progress reports it.
SubvolumeStatus status_of(const StoredSubvolume& subvolume, uint32_t grid_levels);
// Reports all subvolumes of a build.
void report_subvolumes(std::span<const StoredSubvolume> all, uint32_t grid_levels,
                       Progress& progress);

}  // namespace voxdag
