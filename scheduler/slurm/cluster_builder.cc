#include "scheduler/slurm/cluster_builder.h"

#include <algorithm>
#include <chrono>
#include <set>
#include <thread>
#include <vector>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "scheduler/slurm/stop_tasks.h"
#include "scheduler/stages/partition/partition_stage.h"

namespace voxdag {
namespace {

// Pause between two searches for records.
constexpr double kRecordPauseS = 0.5;
// Pause between the first two queries to Slurm. It doubles up to ClusterOptions::slurm_interval_s.
constexpr double kFirstQueryPauseS = 1;

void sleep_seconds(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

}  // namespace

bool is_merge_job(const BuildSpec& spec) {
  return spec.run.cluster && spec.run.cluster->is_merge_job;
}

void check_cluster(const BuildSpec& spec, const BuildContext& context) {
  if (!spec.run.cache_folder.empty())
    throw Error(ErrorCode::kInvalidInput,
                "--cache: tasks of a cluster have no cache: expected "
                "--cluster without it");
  const ClusterOptions& options = *spec.run.cluster;
  Slurm slurm(commands_of(spec), context.cancel, options.slurm_start_s);
  const double pause_s = std::min(kFirstQueryPauseS, options.slurm_interval_s);
  std::vector<std::string> words = split_words(options.submit_options);
  slurm.check(words, pause_s, context.progress);
  if (!options.merge_job || options.merge_job->submit_options.empty()) return;
  const std::vector<std::string>& more = options.merge_job->submit_options;
  words.insert(words.end(), more.begin(), more.end());
  slurm.check(words, pause_s, context.progress);
}

void ClusterBuilder::resume(const std::string& scene_digest) {
  batches_.resume(scene_digest, job_.shape());
  records_.collect();
  records_.remove_unused_batches();
}

void ClusterBuilder::build(PreparedScene& scene, std::span<const StoredSubvolume> planned) {
  add_batches(scene, planned);
  job_.checkpoint.finish();
  job_.report.spill_bytes += scene.triangles ? scene.triangles->file_bytes() : 0;
  scene.triangles.reset();
  job_.clock.finish("batches");
  if (!cluster_.options.merge_job) wait_for_batches();
  job_.clock.finish("build");
}

void ClusterBuilder::add_batches(PreparedScene& scene, std::span<const StoredSubvolume> planned) {
  const std::set<SubvolumeId> open = batches_.subvolumes();
  std::vector<StoredSubvolume> added;
  std::vector<Cube> cubes;
  for (const StoredSubvolume& subvolume : planned) {
    if (open.contains(subvolume.id)) continue;
    added.push_back(subvolume);
    cubes.push_back(subvolume.cube);
  }
  if (added.empty()) return;
  const std::vector<BinId> bins = partition_prepared(scene, cubes, job_.checkpoint, job_.stage());
  job_.clock.finish("partition");
  batches_.add(added, bins, *scene.triangles);
}

void ClusterBuilder::wait_for_batches() {
  Progress& progress = cluster_.progress();
  const double max_pause_s = cluster_.options.slurm_interval_s;
  const uint64_t total = job_.store->leaves().size();
  progress.begin_stage("build", total, "subvolumes");
  progress.resume_at(total - batches_.subvolumes().size());
  tasks_.begin_run();
  if (!batches_.open().empty()) tasks_.poll();
  double polled_s = wall_seconds();
  double pause_s = std::min(kFirstQueryPauseS, max_pause_s);
  for (;;) {
    records_.collect();
    if (batches_.open().empty()) break;
    if (batches_.is_changed()) {
      batches_.try_save();
      batches_.show_tasks();
    }
    job_.context.cancel.check();
    if (wall_seconds() - polled_s >= pause_s) {
      tasks_.poll();
      pause_s = std::min(2 * pause_s, max_pause_s);
      polled_s = wall_seconds();
    }
    sleep_seconds(std::min(kRecordPauseS, max_pause_s));
  }
  batches_.try_save();
  batches_.show_tasks();
  progress.end_stage();
}

std::string ClusterBuilder::submit_merge_job() {
  tasks_.begin_run();
  for (;;) {
    records_.collect();
    if (const std::string id = tasks_.try_submit_merge_job(); !id.empty()) return id;
    job_.context.cancel.check();
    sleep_seconds(cluster_.options.slurm_interval_s);
  }
}

void ClusterBuilder::add_to(BuildReport& report) const {
  const ClusterTotals& totals = batches_.state().totals;
  report.backend = "slurm";
  report.cluster = totals;
  report.subvolumes_split = totals.split;
}

void accept_earlier_tasks(BuildJob& job, const std::string& scene_digest) {
  if (job.context.files.exists(job.work.cluster_path())) ClusterBuilder(job).resume(scene_digest);
}

void remove_tasks(BuildJob& job) {
  if (!job.context.files.exists(job.work.cluster_path())) return;
  try {
    stop_cluster_tasks(job.context.files, job.work.path(), commands_of(job.spec),
                       is_merge_job(job.spec));
  } catch (const Error& error) {
    job.context.progress.warn(error.message());
  }
  job.work.remove_cluster_files();
}

}  // namespace voxdag
