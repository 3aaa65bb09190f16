// One task of a cluster build: builds the subvolumes of a batch, merges their artifacts into one,
// and writes a segment and a completion record to the shared disk. Everything else is temporary and
// on this machine. Any number of attempts at the same batch may run at once.
#pragma once

#include <cstdint>
#include <string>

#include "scheduler/slurm/files/completion_record.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {

struct BatchRun {
  std::string work_folder;  // of the build, on the shared disk
  uint32_t batch = 0;
  std::string program;           // this program's version
  std::string temporary_folder;  // on this machine; "" for $TMPDIR or /tmp
  uint64_t memory_bytes = 0;     // 0 for what Slurm has given to the task, else half of the RAM
  unsigned threads = 0;          // 0 for the CPUs that Slurm has given to the task, else all
  std::string attempt;           // tells this attempt from all others; "" for a new one
};

// Returns the record; one that an earlier attempt wrote if there is one. A failure is recorded too,
// so that whoever waits learns its reason, and thrown. Throws Error{kUnsupportedVersion} naming
// both versions for a batch that another version of voxdag wrote.
CompletionRecord run_batch(const BatchRun& run, const BuildContext& context);

// What Slurm's environment gives to a task; 0 for what it does not say.
struct Allocation {
  unsigned cpus = 0;
  uint64_t memory_bytes = 0;
  std::string task;  // JOB_INDEX
};
Allocation slurm_allocation();

// The build of a batch may take this much of what a task was given: the rest is for the program
// itself, buffers and the page tables.
uint64_t batch_budget(uint64_t given_bytes);
// What a task has to be given for this budget.
uint64_t allocation_for(uint64_t budget_bytes);

}  // namespace voxdag
