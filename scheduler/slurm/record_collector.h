// Accepts the results of a cluster build's tasks: completion records, and the reasons of failed
// attempts. The first valid record of a batch is accepted; later ones are removed. Used by one
// thread.
#pragma once

#include <map>
#include <set>
#include <string>

#include "core/base/error.h"
#include "scheduler/slurm/batch_table.h"
#include "scheduler/slurm/cluster_context.h"
#include "scheduler/slurm/files/cluster_folder.h"
#include "scheduler/slurm/files/completion_record.h"

namespace voxdag {

class RecordCollector {
 public:
  RecordCollector(ClusterContext& cluster, BatchTable& batches)
      : cluster_(cluster), batches_(batches) {}

  // Reads the cluster folder. Records built batches in `batches`, and stores the errors of failed
  // attempts in their batches. Removes the files of attempts whose batches are no longer open.
  void collect();
  // Removes batch files that belong to no open batch.
  void remove_unused_batches();

 private:
  using Seconds = double;

  void read_failure(const ClusterFolder::Entry& entry);
  void read_record(const ClusterFolder::Entry& entry);
  bool may_appear_later(const std::string& record_path);
  void accept(const CompletionRecord& record);
  void reject(const ClusterFolder::Entry& entry, OpenBatch& batch, const Error& error);
  void remove_attempt(const ClusterFolder::Entry& entry);

  ClusterContext& cluster_;
  BatchTable& batches_;
  // Paths of records that cannot be read yet or whose segment is not visible yet, each with the
  // time when this process first tried to read the record.
  std::map<std::string, Seconds> incomplete_since_;
  // Paths of rejected record and failure files. collect() skips them, because some cannot be
  // removed, such as a folder with the name of a record.
  std::set<std::string> rejected_;
};

}  // namespace voxdag
