// Builds subvolumes in tasks of Slurm. The submitting process cuts the planned subvolumes into
// batches (BatchTable), submits a task for each (TaskPoller) and records the tasks' results in the
// job store (RecordCollector). The merge then runs as in any build.
#include <algorithm>
#include <chrono>
#include <set>
#include <thread>
#include <vector>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "scheduler/cluster/cluster.h"
#include "scheduler/slurm/batch_table.h"
#include "scheduler/slurm/cluster_context.h"
#include "scheduler/slurm/record_collector.h"
#include "scheduler/slurm/task_poller.h"
#include "scheduler/stages/partition/partition_stage.h"
#include "scheduler/stages/rows/prepare_rows.h"

namespace voxdag {
namespace {

// Pause between two searches for records.
constexpr double kRecordPauseS = 0.5;
// Pause between the first two queries to Slurm. The pause doubles after each query, up to
// ClusterOptions::slurm_interval_s.
constexpr double kFirstQueryPauseS = 1;

void sleep_seconds(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

class SlurmBuilder : public ClusterBuilder {
 public:
  explicit SlurmBuilder(BuildJob& job) : job_(job), cluster_(job) {}

  // Continues an earlier run. The unfinished batches of that run remain open. Accepts completion
  // records that the tasks of that run wrote after the run had ended.
  void resume(const std::string& scene_digest) override;
  // Cuts the triangles of `planned` into batches. Then waits until all batches are built, unless a
  // merge job will wait for them. Throws Error with the reason of the last failure if a batch has
  // failed too often; other tasks continue to run.
  void build(PreparedScene& scene, std::span<const StoredSubvolume> planned) override;
  void add_to(BuildReport& report) const override;
  std::string submit_merge_job() override;

 private:
  void add_batches(PreparedScene& scene, std::span<const StoredSubvolume> planned);
  void wait_for_batches();

  BuildJob& job_;
  ClusterContext cluster_;
  BatchTable batches_{cluster_};
  RecordCollector records_{cluster_, batches_};
  TaskPoller tasks_{cluster_, batches_};
};

void SlurmBuilder::resume(const std::string& scene_digest) {
  batches_.resume(scene_digest, job_.shape());
  records_.collect();
  records_.remove_unused_batches();
}

void SlurmBuilder::build(PreparedScene& scene, std::span<const StoredSubvolume> planned) {
  add_batches(scene, planned);
  job_.checkpoint.finish();
  job_.report.spill_bytes += scene.triangles ? scene.triangles->file_bytes() : 0;
  scene.triangles.reset();
  job_.clock.finish("batches");
  if (!cluster_.options.merge_job) wait_for_batches();
  job_.clock.finish("build");
}

void SlurmBuilder::add_batches(PreparedScene& scene, std::span<const StoredSubvolume> planned) {
  const std::set<SubvolumeId> open = batches_.subvolumes();
  std::vector<StoredSubvolume> added;
  std::vector<Cube> cubes;
  for (const StoredSubvolume& subvolume : planned) {
    if (open.contains(subvolume.id)) continue;
    added.push_back(subvolume);
    cubes.push_back(subvolume.cube);
  }
  const bool needs_rows = job_.rows && !job_.rows->is_ready();
  if (added.empty() && !needs_rows) return;
  const std::vector<BinId> bins = partition_prepared(scene, cubes, job_.checkpoint, job_.stage());
  job_.clock.finish("partition");
  prepare_rows(job_, added, bins, *scene.triangles);
  if (!added.empty()) batches_.add(added, bins, *scene.triangles);
}

void SlurmBuilder::wait_for_batches() {
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

std::string SlurmBuilder::submit_merge_job() {
  tasks_.begin_run();
  for (;;) {
    records_.collect();
    if (const std::string id = tasks_.try_submit_merge_job(); !id.empty()) return id;
    job_.context.cancel.check();
    sleep_seconds(cluster_.options.slurm_interval_s);
  }
}

void SlurmBuilder::add_to(BuildReport& report) const {
  const ClusterTotals& totals = batches_.state().totals;
  report.backend = "slurm";
  report.cluster = totals;
  report.subvolumes_split = totals.split;
}

}  // namespace

void check_cluster_support() {}

void check_cluster(const BuildSpec& spec, const BuildContext& context) {
  if (!spec.run.cache_folder.empty())
    throw Error(ErrorCode::kInvalidInput, option_text("cache") +
                                              ": tasks of a cluster have no cache: expected " +
                                              option_text("cluster") + " without it");
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

std::unique_ptr<ClusterBuilder> make_cluster_builder(BuildJob& job) {
  return std::make_unique<SlurmBuilder>(job);
}

void accept_earlier_tasks(BuildJob& job, const std::string& scene_digest) {
  if (job.context.files.exists(job.work.cluster_path())) SlurmBuilder(job).resume(scene_digest);
}

}  // namespace voxdag
