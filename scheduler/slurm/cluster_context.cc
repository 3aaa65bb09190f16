#include "scheduler/slurm/cluster_context.h"

#include <filesystem>

namespace voxdag {

CommandRunner& commands_of(const BuildSpec& spec) {
  return spec.run.cluster && spec.run.cluster->commands ? *spec.run.cluster->commands
                                                        : system_commands();
}

ClusterContext::ClusterContext(BuildJob& build_job)
    : job(build_job),
      options(job.spec.run.cluster.value_or(ClusterOptions{})),
      folder(job.work.path()),
      slurm(commands_of(job.spec), job.context.cancel, options.slurm_start_s) {}

std::string absolute_path(const std::string& path) {
  return std::filesystem::absolute(path).lexically_normal().string();
}

}  // namespace voxdag
