// The completion record of a cluster task: one small file, created by an atomic rename after the
// task's segment is durable. It has a line of JSON and a line with the JSON's XXH64, which detects
// a torn or damaged record.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/dag/sub_dag.h"
#include "core/format/artifact/artifact.h"
#include "core/io/file_system.h"
#include "scheduler/state/job_store.h"

namespace voxdag {

// Maximum size of the record of a batch with this number of subvolumes.
inline constexpr uint64_t max_record_bytes(uint64_t subvolumes) {
  return (uint64_t{64} << 10) + 512 * subvolumes;
}
// Maximum size of the record of a failure.
inline constexpr uint64_t kMaxFailureBytes = uint64_t{64} << 10;

struct BuiltSubvolume {
  SubvolumeId id = 0;
  SubDagSummary summary;  // if the subvolume was split: the summary of all its parts
};

struct CompletionRecord {
  std::string program;  // voxdag version; must be the same as the batch's (batch_file.h)
  std::string build;    // id of the build, as in the batch
  uint32_t batch = 0;
  std::string attempt;
  std::string node;      // the machine that built the batch
  std::string task;      // the task's name in Slurm, JOB_INDEX
  ArtifactRef artifact;  // one artifact for all subvolumes; 0 bytes if none has a voxel
  uint64_t segment_bytes = 0;
  std::vector<BuiltSubvolume> subvolumes;
  uint64_t rows_before = 0,
           rows_after = 0;  // DAG nodes before and after the merge of the artifacts
  uint64_t split = 0;       // subvolumes that were split
  double started_s = 0;     // Unix time
  double wall_s = 0, cpu_s = 0;
  uint64_t peak_rss_bytes = 0;
};

std::string encode_record(const CompletionRecord& record);
// Decodes a record. Throws Error{kCorrupt} for a text not created by encode_record().
CompletionRecord decode_record(const std::string& text);

// The reason why an attempt ended without a record, as reported by the task.
struct AttemptFailure {
  uint32_t batch = 0;
  std::string attempt, node, task;
  std::string message;
};
std::string encode_failure(const AttemptFailure& failure);
AttemptFailure decode_failure(const std::string& text);

}  // namespace voxdag
