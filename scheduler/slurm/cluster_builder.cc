#include "scheduler/slurm/cluster_builder.h"

#include <set>
#include <vector>

#include "core/base/error.h"
#include "scheduler/stages/partition/partition_stage.h"

namespace voxdag {
namespace {

std::unique_ptr<ClusterBuild> open_cluster(BuildJob& job, const std::string& scene_digest) {
  auto cluster = std::make_unique<ClusterBuild>(job.spec, job.work, *job.store, job.context,
                                                commands_of(job.spec));
  cluster->resume(scene_digest, job.shape());
  return cluster;
}

}  // namespace

CommandRunner& commands_of(const BuildSpec& spec) {
  return spec.run.cluster && spec.run.cluster->commands ? *spec.run.cluster->commands
                                                        : system_commands();
}

bool is_merge_job(const BuildSpec& spec) {
  return spec.run.cluster && spec.run.cluster->is_merge_job;
}

void ClusterBuilder::resume(const std::string& scene_digest) {
  cluster_ = open_cluster(job_, scene_digest);
}

void ClusterBuilder::build(PreparedScene& scene, std::span<const StoredSubvolume> planned) {
  const std::set<SubvolumeId> covered = cluster_->covered();
  std::vector<StoredSubvolume> added;
  std::vector<Cube> cubes;
  for (const StoredSubvolume& subvolume : planned) {
    if (covered.contains(subvolume.id)) continue;
    added.push_back(subvolume);
    cubes.push_back(subvolume.cube);
  }
  if (!added.empty()) {
    const std::vector<BinId> bins = partition_prepared(scene, cubes, job_.checkpoint, job_.stage());
    job_.clock.finish("partition");
    cluster_->add(added, bins, *scene.triangles, job_.spec.run.threads);
  }
  job_.checkpoint.finish();
  job_.report.spill_bytes += scene.triangles ? scene.triangles->file_bytes() : 0;
  scene.triangles.reset();
  job_.clock.finish("batches");
  if (!job_.spec.run.cluster->merge_job) cluster_->follow();
  job_.clock.finish("build");
}

void ClusterBuilder::add_to(BuildReport& report) const {
  report.backend = "slurm";
  report.cluster = cluster_->totals();
  report.subvolumes_split = cluster_->totals().split;
}

void accept_earlier_tasks(BuildJob& job, const std::string& scene_digest) {
  if (job.context.files.exists(job.work.cluster_path())) open_cluster(job, scene_digest);
}

void remove_tasks(BuildJob& job) {
  if (!job.context.files.exists(job.work.cluster_path())) return;
  try {
    ClusterBuild::stop_tasks(job.context.files, job.work.path(), commands_of(job.spec),
                             is_merge_job(job.spec));
  } catch (const Error& error) {
    job.context.progress.warn(error.message());
  }
  job.work.remove_cluster_files();
}

}  // namespace voxdag
