// The folders of jobs, DATA/jobs/ID: finds the job of each folder, and deletes folders. Calls for
// different jobs may run concurrently.
//
// A deletion first marks the job's folder by renaming it. Then it removes the folder's files, the
// job's record and the renamed folder, in this order. Because the renamed folder remains until the
// end, a deletion that a crash interrupts can be finished. Deletions work even on a full disk. Only
// folders that a deletion has marked are removed. A folder without a record is kept, because the
// queue may come from an old backup.
#pragma once

#include <string>
#include <vector>

#include "server/base/steps.h"
#include "server/disk/data_folder.h"
#include "server/jobs/protocol/job_folder.h"
#include "server/queue/job_queue.h"

namespace voxdag::server {

class JobFolders {
 public:
  JobFolders(const std::string& path, FileSystem& files, JobQueue& queue, Steps& steps, Log log);

  JobFolder of(const std::string& id) const { return {path_ + "/" + id}; }

  // Creates records for folders that the queue does not know. The new jobs of folders with a result
  // are in the state succeeded, all other new jobs in the state suspended.
  void adopt();
  // Removes the work folders of jobs that no longer need them.
  void clean_up();
  // Removes the work folder of a job and the partial output.
  void remove_work(const std::string& id);
  // Marks the folder of a job, if it has one. From this call on the job counts as being deleted.
  // The call is fast, unless an earlier deletion left files under the marked name.
  void mark(const std::string& id);
  bool is_marked(const std::string& id) const { return files_.exists(of(id).path + kDeleted); }
  // Returns the ids of the jobs whose folders are marked.
  std::vector<std::string> marked() const;
  // Removes the files marked by mark() and the job's record. Throws RequestError{kConflict} if the
  // job has not ended.
  void remove_marked(const std::string& id);
  // Like remove_marked(), for a deletion interrupted by a crash or an error. The job is kept if it
  // has not ended, or if it has a new folder.
  void finish_deletion(const std::string& id);

 private:
  const std::string path_;
  FileSystem& files_;
  JobQueue& queue_;
  Steps& steps_;
  const Log log_;
};

}  // namespace voxdag::server
