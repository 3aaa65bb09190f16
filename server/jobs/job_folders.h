// The folders of jobs, DATA/jobs/ID: which job each belongs to, and their deletion. Not
// thread-safe, but for of().
//
// A deletion renames the folder, then removes its files, the job's record and the renamed folder: a
// crash in between loses neither, and a full disk can be emptied. Only what such a deletion has
// marked is removed; a folder without a record stays, since the queue may be an old one.
#pragma once

#include <string>

#include "server/jobs/process/job_folder.h"
#include "server/queue/job_queue.h"
#include "server/steps.h"

namespace voxdag::server {

class JobFolders {
 public:
  JobFolders(const std::string& path, FileSystem& files, JobQueue& queue, Steps& steps, Log log);

  JobFolder of(const std::string& id) const { return {path_ + "/" + id}; }

  // Makes records of the folders that the queue does not know: jobs with a result have succeeded,
  // others are suspended.
  void adopt();
  // Removes the work folders of jobs that need them no more.
  void clean_up();
  void remove_work(const std::string& id);
  // Deletes a job and its files. What a crash or a full disk interrupts is finished by
  // finish_deletions().
  void remove(const std::string& id);
  void finish_deletions();

 private:
  void try_to_remove(const std::string& id);

  const std::string path_;
  FileSystem& files_;
  JobQueue& queue_;
  Steps& steps_;
  const Log log_;
  double next_deletions_s_ = 0;  // in wall_seconds(); infinite if no folder is marked
};

}  // namespace voxdag::server
