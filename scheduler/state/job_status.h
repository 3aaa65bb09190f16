// The state of a build, read from its work folder. It can be read at any time, even while another
// process builds.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/io/file_system.h"
#include "scheduler/state/job_store.h"

namespace voxdag {

struct JobStatus {
  bool running = false;  // a process has locked the folder
  std::string holder;    // the process that has locked the folder
  std::string geometry;  // options as JSON; "" before the job began
  uint64_t subvolumes = 0;
  uint64_t built = 0;
  std::optional<ProgressSnapshot> progress;
  std::vector<StageTime> stages;

  // Units per second in the current stage, and remaining seconds at that rate; 0 if unknown.
  double rate() const;
  double eta_s() const;
};

// Reads the state of the build in a work folder. Throws Error{kNotFound} if the folder has no job
// store.
JobStatus read_job_status(FileSystem& files, const std::string& work_folder);

// Returns one JSON object with the names in docs/cli.md. `cluster` is the JSON status of a cluster
// build, or "" for any other build.
std::string status_json(const JobStatus& status, const std::string& cluster = "");

}  // namespace voxdag
