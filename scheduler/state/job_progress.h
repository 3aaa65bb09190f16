// Forwards a build's progress, and writes it to the job store about once per second, so that
// `voxdag status` can show it from another process. A short build ends before the first write, so
// its store needs no file. Thread-safe.
//
// When a write is due, the thread that reports progress lists the work folder and writes the row of
// the progress. No other thread waits for it. This takes too little time to need a separate thread.
#pragma once

#include <mutex>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/base/warning.h"
#include "scheduler/state/job_store.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {

class JobProgress : public Progress {
 public:
  // `is_strict`: warnings about the input are errors. If the store is in memory, it gets its file
  // when progress is first reported after `first_write_s` seconds.
  JobProgress(Progress& shown, JobStore& store, const WorkFolder& work, bool is_strict,
              double first_write_s)
      : shown_(shown),
        work_(work),
        is_strict_(is_strict),
        next_write_s_(wall_seconds() + first_write_s),
        store_(&store) {}

  void begin_stage(std::string_view stage, uint64_t total, std::string_view unit) override;
  void resume_at(uint64_t done) override;
  void advance(uint64_t count) override;
  void set_total(uint64_t total) override;
  void end_stage() override;
  void warn(std::string_view message) override { shown_.warn(message); }
  // Forwards the warning and records it for the report. In a strict build, throws it as an error.
  void warn_of_input(const Warning& warning) override;
  void set_subvolumes(uint64_t resolution, std::span<const SubvolumeStatus> all) override {
    shown_.set_subvolumes(resolution, all);
  }
  void set_grid(const std::array<double, 3>& origin, double edge) override {
    shown_.set_grid(origin, edge);
  }
  void subvolume_begun(int64_t id) override { shown_.subvolume_begun(id); }
  void subvolume_built(const SubvolumeStatus& built) override { shown_.subvolume_built(built); }
  void subvolume_split(int64_t id, std::span<const SubvolumeStatus> parts) override {
    shown_.subvolume_split(id, parts);
  }
  void set_cluster_tasks(const ClusterTasks& tasks) override { shown_.set_cluster_tasks(tasks); }
  void record_failure(const Error& error);
  // After this call progress is only forwarded, because the store is about to close.
  void detach();

 private:
  enum class Write { kIfDue, kUnlessEarly, kNow };
  // Changes the snapshot. Writes it to the store if the next periodic write is due. If it is not
  // due yet, kUnlessEarly writes the snapshot if the store has a file, and kNow always writes it.
  template <class Change>
  void update(Write write, const Change& change);
  void write(bool is_early);

  Progress& shown_;
  const WorkFolder& work_;
  const bool is_strict_;
  std::mutex mutex_;  // guards the next two members
  ProgressSnapshot snapshot_;
  double next_write_s_;
  std::mutex store_mutex_;  // guards store_; a thread that locks both mutexes locks this one first
  JobStore* store_;
};

// Throws the warning as Error{kInvalidInput}. Used in a strict build.
[[noreturn]] void refuse_warning(const Warning& warning);

// Returns a subvolume in the form that Progress reports.
SubvolumeStatus status_of(const StoredSubvolume& subvolume, uint32_t grid_levels);
// Reports all subvolumes of a build.
void report_subvolumes(std::span<const StoredSubvolume> all, uint32_t grid_levels,
                       Progress& progress);

}  // namespace voxdag
