#include "server/jobs/job_folders.h"

#include "core/base/clock.h"
#include "core/io/random_id.h"
#include "scheduler/cluster/cluster.h"
#include "server/jobs/process/job_process.h"
#include "server/jobs/protocol/job_task.h"
#include "server/jobs/task_resolver.h"

namespace voxdag::server {
namespace {

// Returns the id of a job from the name of a folder that a deletion has renamed; "" for other
// folders.
std::string marked_job(const DirectoryEntry& entry) {
  const std::string id = entry.name.substr(0, entry.name.find('.'));
  return entry.is_directory && is_random_id(id) && entry.name == id + kDeleted ? id : "";
}

}  // namespace

JobFolders::JobFolders(const std::string& path, FileSystem& files, JobQueue& queue, Steps& steps,
                       Log log)
    : path_(path), files_(files), queue_(queue), steps_(steps), log_(std::move(log)) {
  files_.make_directories(path_);
}

void JobFolders::adopt() {
  for (const DirectoryEntry& entry : files_.list(path_)) {
    if (!entry.is_directory || !is_random_id(entry.name) || queue_.find(entry.name)) continue;
    steps_.run("adopt job " + entry.name, [&] {
      const JobFolder place = of(entry.name);
      const JobRequest request = parse_job_request(read_task(files_, place.task()).request);
      Job job;
      job.id = entry.name;
      job.request = request.text;
      job.scenes = TaskResolver::uploads_of(request);
      job.posted_by = "adopted";
      job.state = JobState::kSuspended;
      if (files_.exists(place.report())) {
        job.result = finished_result(files_, place);
        job.state = JobState::kSucceeded;
        job.finished_s = unix_seconds();
      }
      queue_.add(job, {}, UINT64_MAX);
      log_({"job " + job.id + " adopted: " + state_name(job.state), LogLevel::kInfo, job.id});
    });
  }
}

void JobFolders::clean_up() {
  std::string foreign;
  for (const DirectoryEntry& entry : files_.list(path_)) {
    if (!marked_job(entry).empty()) continue;
    steps_.run("clean up jobs/" + entry.name, [&] {
      const auto job = queue_.find(entry.name);
      if (!job) foreign += " jobs/" + entry.name;
      // A suspended or failed job may still have cluster tasks that run: the service may have been
      // killed before it stopped them.
      else if (job->state == JobState::kSuspended || job->state == JobState::kFailed)
        // `true`: does not stop a merge job of Slurm, because the service never submits one.
        stop_cluster_tasks(files_, of(entry.name).work(), true);
      else if (has_ended(job->state) && job->state != JobState::kFailed)
        remove_work(entry.name);
    });
  }
  if (!foreign.empty())
    log_({"kept, because no job of the queue has this folder:" + foreign, LogLevel::kWarning});
}

void JobFolders::remove_work(const std::string& id) {
  const std::string work = of(id).work(), partial = of(id).result() + ".partial";
  steps_.run("stop the cluster's tasks of job " + id, [&] { stop_cluster_tasks(files_, work); });
  remove_tree(files_, work);
  if (files_.exists(partial)) files_.remove(partial);
}

void JobFolders::mark(const std::string& id) {
  const std::string path = of(id).path;
  if (!files_.exists(path)) return;
  remove_tree(files_, path + kDeleted);
  files_.rename(path, path + kDeleted);
}

std::vector<std::string> JobFolders::marked() const {
  std::vector<std::string> ids;
  for (const DirectoryEntry& entry : files_.list(path_))
    if (const std::string id = marked_job(entry); !id.empty()) ids.push_back(id);
  return ids;
}

void JobFolders::remove_marked(const std::string& id) {
  const std::string marked = of(id).path + kDeleted;
  files_.sync_directory(path_);
  remove_entries(files_, marked);
  if (queue_.find(id)) queue_.remove(id);
  remove_tree(files_, marked);
  log_({"job " + id + " deleted", LogLevel::kInfo, id});
}

void JobFolders::finish_deletion(const std::string& id) {
  const auto job = queue_.find(id);
  if (!job || (has_ended(job->state) && !files_.exists(of(id).path))) return remove_marked(id);
  remove_tree(files_, of(id).path + kDeleted);
  log_({"job " + id + ": removed the remains of an interrupted deletion; the job is kept",
        LogLevel::kInfo, id});
}

}  // namespace voxdag::server
