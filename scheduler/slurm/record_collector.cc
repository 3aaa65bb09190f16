#include "scheduler/slurm/record_collector.h"

#include <vector>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "scheduler/slurm/files/record_check.h"

namespace voxdag {
namespace {

std::string replace_all(std::string text, const std::string& from, const std::string& to) {
  for (size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

}  // namespace

void RecordCollector::collect() {
  const std::vector<ClusterFolder::Entry> entries = cluster_.folder.list(cluster_.files());
  for (const ClusterFolder::Entry& entry : entries) {
    if (rejected_.contains(entry.path)) continue;
    if (entry.kind == ClusterFolder::Kind::kRecord) read_record(entry);
    if (entry.kind == ClusterFolder::Kind::kFailure) read_failure(entry);
  }
  // Removes the folders that killed attempts left behind, if their batches are no longer open.
  for (const ClusterFolder::Entry& entry : entries)
    if (entry.kind == ClusterFolder::Kind::kAttempt && !batches_.find(entry.batch))
      remove_attempt(entry);
}

void RecordCollector::remove_unused_batches() {
  for (const ClusterFolder::Entry& entry : cluster_.folder.list(cluster_.files()))
    if (entry.kind == ClusterFolder::Kind::kBatch && !batches_.find(entry.batch))
      cluster_.files().remove(entry.path);
}

void RecordCollector::read_failure(const ClusterFolder::Entry& entry) {
  if (OpenBatch* const batch = batches_.find(entry.batch)) {
    try {
      const AttemptFailure failure =
          decode_failure(read_own_file(cluster_.files(), entry.path, kMaxFailureBytes));
      // On a shared file system the failure of an earlier task can become visible when the batch
      // already has a new task.
      const bool is_earlier =
          batch->task && !failure.task.empty() && failure.task != batch->task->name();
      // Tasks use the absolute path of the work folder; the message shows the user's path.
      const std::string& work = cluster_.job.work.path();
      const bool is_of_entry = failure.batch == entry.batch && failure.attempt == entry.attempt;
      if (!is_earlier && is_of_entry)
        batch->error = {replace_all(failure.message, absolute_path(work), work) +
                            (failure.node.empty() ? "" : " (on " + failure.node + ")"),
                        true};
    } catch (const Error&) {
      // The file is damaged or no longer exists. Slurm will report that the task ended.
      rejected_.insert(entry.path);
    }
  }
  remove_attempt(entry);
}

void RecordCollector::read_record(const ClusterFolder::Entry& entry) {
  OpenBatch* const batch = batches_.find(entry.batch);
  // If the batch is no longer open, another attempt's record was already accepted.
  if (!batch) return remove_attempt(entry);
  bool is_read = false;
  try {
    const CompletionRecord record = read_valid_record(cluster_.files(), cluster_.folder, entry,
                                                      batches_.state(), batch->subvolumes);
    is_read = true;
    accept(record);
  } catch (const Error& error) {
    // Anything can have the name of a record: a pipe, a folder, a file of another user or of any
    // size. Such a file is rejected, and the build continues.
    const bool is_foreign = error.code() == ErrorCode::kInvalidInput ||
                            error.code() == ErrorCode::kLimit || error.code() == ErrorCode::kIo;
    if (!error.is_corruption() && (is_read || !is_foreign)) throw;
    const bool is_unreadable =
        error.code() == ErrorCode::kNotFound || error.code() == ErrorCode::kIo;
    if (is_unreadable && may_appear_later(entry.path)) return;
    reject(entry, *batch, error);
  }
}

void RecordCollector::reject(const ClusterFolder::Entry& entry, OpenBatch& batch,
                             const Error& error) {
  const std::string rejection = "the record " + entry.path + " is rejected: " + error.message();
  cluster_.progress().warn(rejection);
  // has_ended is false, because the record can come from an earlier attempt while the batch's
  // present task still runs.
  if (!batch.error) batch.error = {rejection, false};
  rejected_.insert(entry.path);
  remove_attempt(entry);
}

// Returns true during the grace period after the first call for this record. On a shared file
// system the segment can become visible later than its record.
bool RecordCollector::may_appear_later(const std::string& record_path) {
  const double now_s = wall_seconds();
  const Seconds since_s = incomplete_since_.try_emplace(record_path, now_s).first->second;
  return now_s - since_s < cluster_.options.grace_s;
}

void RecordCollector::accept(const CompletionRecord& record) {
  FileSystem& files = cluster_.files();
  const std::string accepted = cluster_.folder.accepted_segment_path(record.batch);
  const std::string segment = segment_of_record(files, cluster_.folder, record);
  if (record.artifact.bytes > 0 && segment != accepted) {
    files.rename(segment, accepted);
    files.sync_directory(cluster_.job.work.path());
  }
  batches_.record_built(record);
  cluster_.folder.remove_attempt(files, record.batch, record.attempt);
  if (const std::string batch = cluster_.folder.batch_path(record.batch); files.exists(batch))
    files.remove(batch);
}

void RecordCollector::remove_attempt(const ClusterFolder::Entry& entry) {
  cluster_.folder.remove_attempt(cluster_.files(), entry.batch, entry.attempt);
}

}  // namespace voxdag
