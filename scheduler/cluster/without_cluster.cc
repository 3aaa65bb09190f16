// The functions of cluster.h in a program without cluster support.
#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "scheduler/cluster/cluster.h"

namespace voxdag {
namespace {

constexpr const char* kExpectation =
    "this voxdag was built without cluster support: expected one built with VOXDAG_CLUSTER=ON";

[[noreturn]] void refuse() { throw Error(ErrorCode::kInvalidInput, kExpectation); }

bool has_tasks(FileSystem& files, const std::string& work_folder) {
  return files.exists(work_folder + "/cluster/cluster.json");
}

std::string tasks_message(const std::string& work_folder) {
  return work_folder + ": a build on a cluster has started tasks here, and " + kExpectation;
}

}  // namespace

void check_cluster_support() { refuse(); }

void check_cluster(const BuildSpec&, const BuildContext&) { refuse(); }

std::unique_ptr<ClusterBuilder> make_cluster_builder(BuildJob&) { refuse(); }

std::unique_ptr<MergeJob> make_merge_job(const BuildSpec&, const TriangleSource&,
                                         const BuildContext&) {
  refuse();
}

void accept_earlier_tasks(BuildJob& job, const std::string&) {
  if (has_tasks(job.context.files, job.work.path()))
    throw Error(ErrorCode::kInvalidInput, tasks_message(job.work.path()) + ", or " +
                                              option_text("restart") + " to start over");
}

void remove_tasks(BuildJob& job) {
  if (has_tasks(job.context.files, job.work.path()))
    job.context.progress.warn(tasks_message(job.work.path()) + "; its tasks may still run");
  job.work.remove_cluster_files();
}

void stop_earlier_merge_job(const BuildSpec&, const BuildContext&) {}

void stop_cluster_tasks(FileSystem& files, const std::string& work_folder, bool) {
  if (has_tasks(files, work_folder))
    throw Error(ErrorCode::kInvalidInput, tasks_message(work_folder) + "; its tasks may still run");
}

}  // namespace voxdag
