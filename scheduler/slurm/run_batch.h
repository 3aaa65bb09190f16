// One task of a cluster build. It builds the subvolumes of a batch, merges their artifacts into
// one, and writes a segment and a completion record to the shared disk. All its other files are
// temporary files on the task's own machine. Several attempts at the same batch may run
// concurrently.
#pragma once

#include <cstdint>
#include <string>

#include "scheduler/slurm/files/completion_record.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {

struct BatchRun {
  std::string work_folder;  // the build's work folder, on the shared disk
  uint32_t batch = 0;
  std::string program;           // this program's version
  std::string temporary_folder;  // local folder; "" means $TMPDIR or /tmp
  uint64_t memory_bytes = 0;     // 0: the task's Slurm allocation, else half of the RAM
  unsigned threads = 0;          // 0: the CPUs of the Slurm allocation, else all CPUs
  std::string attempt;           // unique id of the attempt; "" for a new one
};

// Runs one attempt at a batch and returns its completion record. Returns the record of an earlier
// attempt instead if a valid one exists. On failure, writes the error to a file for the submitting
// process and rethrows it. Throws Error{kUnsupportedVersion} with both versions if another version
// of voxdag wrote the batch.
CompletionRecord run_batch(const BatchRun& run, const BuildContext& context);

// A task's allocation according to Slurm's environment variables; 0 if unknown.
struct Allocation {
  unsigned cpus = 0;
  uint64_t memory_bytes = 0;
  std::string task;  // the task's name in Slurm, JOB_INDEX
};
Allocation slurm_allocation();

// Returns the memory budget for building a batch in an allocation of `given_bytes`. The
// allocation's remaining memory is for the program itself, buffers and page tables.
uint64_t batch_budget(uint64_t given_bytes);
// Returns the allocation, in bytes, that a task needs for a memory budget of `budget_bytes`.
uint64_t allocation_for(uint64_t budget_bytes);

}  // namespace voxdag
