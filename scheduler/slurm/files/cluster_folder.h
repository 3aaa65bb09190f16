// The files of a cluster build and their names. The files are in the folder `cluster` of the work
// folder, on the shared disk. voxdag removes no files with other names, except temporary files
// (NAME.partial, .nfs*).
//
//   cluster.json                       state of the submitting process (cluster_state.h)
//   batch-7.vdbatch                    input of batch 7 (batch_file.h)
//   batch-7.record-ATTEMPT.json        record of the built batch (completion_record.h)
//   batch-7.failure-ATTEMPT.json       the reason why the attempt failed
//   attempt-7-ATTEMPT/segment-N.vdseg  output of the attempt
//   log-JOB_INDEX.txt                  output of a task
//   log-JOB.txt                        output of the merge job
//
// ATTEMPT is the random id of an attempt at a batch; N is the segment's id (segment_of()).
//
// The segment of a batch's first valid record is moved to the work folder, where the merge reads
// it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/io/file_system.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {

inline constexpr uint32_t kMaxBatches = uint32_t{1} << 24;

class ClusterFolder {
 public:
  explicit ClusterFolder(const std::string& work_folder)
      : work_folder_(work_folder), path_(path_in(work_folder)) {}
  static std::string path_in(const std::string& work_folder) { return work_folder + "/cluster"; }

  const std::string& work_folder() const { return work_folder_; }
  const std::string& path() const { return path_; }
  std::string state_path() const { return path_ + "/cluster.json"; }
  std::string batch_path(uint32_t batch) const { return named(batch, ".vdbatch"); }
  std::string record_path(uint32_t batch, const std::string& attempt) const {
    return named(batch, ".record-" + attempt + ".json");
  }
  std::string failure_path(uint32_t batch, const std::string& attempt) const {
    return named(batch, ".failure-" + attempt + ".json");
  }
  std::string attempt_folder(uint32_t batch, const std::string& attempt) const {
    return path_ + "/attempt-" + std::to_string(batch) + "-" + attempt;
  }
  static uint32_t segment_of(uint32_t batch) { return kFirstClusterSegment + batch; }
  // Path of a batch's segment after its record was accepted.
  std::string accepted_segment_path(uint32_t batch) const;

  enum class Kind { kBatch, kRecord, kFailure, kAttempt, kOther };
  struct Entry {
    Kind kind = Kind::kOther;
    uint32_t batch = 0;
    std::string attempt;
    std::string path;
  };
  // Returns the folder's entries, sorted by name; none if the folder does not exist.
  std::vector<Entry> list(FileSystem& files) const;

  // Removes the files of an attempt. Errors are ignored.
  void remove_attempt(FileSystem& files, uint32_t batch, const std::string& attempt) const;

 private:
  std::string named(uint32_t batch, const std::string& rest) const {
    return path_ + "/batch-" + std::to_string(batch) + rest;
  }

  std::string work_folder_;
  std::string path_;
};

// Parses the name of an entry. The result has no path. Its kind is kOther for an unknown name.
ClusterFolder::Entry parse_cluster_name(const std::string& name);

}  // namespace voxdag
