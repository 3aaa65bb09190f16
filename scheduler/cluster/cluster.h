// The interface through which other folders run cluster builds. scheduler/slurm/ implements its
// functions. With VOXDAG_CLUSTER=OFF, without_cluster.cc implements them: these versions refuse
// cluster options and cannot stop the tasks of earlier builds.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/io/file_system.h"
#include "scene/triangle_source.h"
#include "scheduler/spec/build_report.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/stages/build/subvolume_builder.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

// Throws Error{kInvalidInput} if this program has no cluster support.
void check_cluster_support();
// Checks a build with cluster options. Throws Error{kInvalidInput} if Slurm is not installed or
// would refuse the build's tasks, or if the build has a cache folder.
void check_cluster(const BuildSpec& spec, const BuildContext& context);

// True if this process runs as the merge job (see MergeJob).
inline bool is_merge_job(const BuildSpec& spec) {
  return spec.run.cluster && spec.run.cluster->is_merge_job;
}

// Builds subvolumes in tasks of a cluster.
class ClusterBuilder : public SubvolumeBuilder {
 public:
  // Submits all batches that Slurm accepts now, and a merge job that starts when the tasks of these
  // batches have ended. Returns the merge job's id. The merge job resubmits failed batches.
  virtual std::string submit_merge_job() = 0;
};
// `job` must outlive the result.
std::unique_ptr<ClusterBuilder> make_cluster_builder(BuildJob& job);

// A cluster build whose merge is also a job of the cluster (`--cluster-merge`). The submitting
// process submits the tasks and a merge job that depends on them, and unlocks the work folder. Then
// it follows the merge job: it shows the job's progress until the job ends. The merge job runs the
// same voxdag command: it resumes the work folder as any later run does, resubmits failed batches,
// waits for their tasks and merges. If the process that follows the merge job is stopped, the user
// can run the same command again. That run follows the job again, or submits it again if Slurm has
// lost it. A process finds a running merge job by the job's name, which contains the id of the
// build in cluster.json. It finds an ended merge job by the report next to the output, which
// contains the job's request().
class MergeJob {
 public:
  virtual ~MergeJob() = default;

  // Digest of the geometry options and of the paths, sizes and modification times of the scene's
  // files. It is computed when this object is made. It includes image files if the build has
  // attributes.
  virtual const std::string& request() const = 0;
  // Returns the report of a finished merge job with the same request(), if its output exists and
  // has the size in the report.
  virtual std::optional<BuildReport> finished() const = 0;
  // True if the work folder still has a job store although the build does not keep its work folder.
  // Then the merge job is still removing the folder, or it was stopped before it did so.
  virtual bool has_remaining_work() const = 0;
  // Removes the report that finished() returns, if any, so that nobody mistakes it for the report
  // of a new merge job.
  virtual void forget_finished() = 0;
  // True if the work folder's merge job is waiting or running. Repeats the query until Slurm
  // answers.
  virtual bool is_alive() = 0;
  // Shows the progress of job `id` ("" if unknown) until it has ended, and returns its report.
  // Throws Error with the job's error code if it fails. Throws Error{kCanceled} if the context is
  // canceled; the job continues to run.
  virtual BuildReport follow(const std::string& id) = 0;
};
// `spec` and `context` must outlive the result.
std::unique_ptr<MergeJob> make_merge_job(const BuildSpec& spec, const TriangleSource& scene,
                                         const BuildContext& context);

// Builds with and without cluster options call the following functions, because it is possible that
// an earlier run in the same work folder has started tasks.

// Records in the job store the results of tasks that an earlier run started for the scene with this
// digest. Throws Error{kInvalidInput} if there are such tasks and this program has no cluster
// support.
void accept_earlier_tasks(BuildJob& job, const std::string& scene_digest);
// Stops the cluster tasks of the work folder and removes their files. Only warns if Slurm does not
// accept the request: a remaining task will fail because its batch file is missing.
void remove_tasks(BuildJob& job);
// Stops the merge job of an earlier build, because that job can hold the locks of the output and
// the work folder. Only warns if the job cannot be stopped.
void stop_earlier_merge_job(const BuildSpec& spec, const BuildContext& context);
// Stops the merge job (unless this process is the merge job), then all tasks of the cluster build
// in a work folder. Does nothing without a cluster build. If Slurm does not accept the request,
// throws Error{kIo} with a command that the user can run to stop the tasks. Throws
// Error{kInvalidInput} if this program has no cluster support.
void stop_cluster_tasks(FileSystem& files, const std::string& work_folder,
                        bool is_merge_job = false);

}  // namespace voxdag
