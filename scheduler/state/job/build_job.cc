#include "scheduler/state/job/build_job.h"

#include <exception>

#include "core/base/error.h"
#include "core/base/options/option_text.h"

namespace voxdag {
namespace {

// Returns the access of a build to its job store. The store of a cluster build must be a file,
// because other processes read it. With keep_work, a file must exist at the end of the build. The
// store of any other build can remain in memory until the build has work to record.
JobStore::Access access_of(const RunOptions& run) {
  return run.cluster || run.keep_work ? JobStore::Access::kBuild : JobStore::Access::kBuildLater;
}

std::unique_ptr<JobStore> open_job_store(FileSystem& files, WorkFolder& work,
                                         const RunOptions& run) {
  const auto open = [&] {
    return std::make_unique<JobStore>(work.store_path(), access_of(run),
                                      [&work] { work.sync_names(); });
  };
  try {
    return open();
  } catch (const Error& error) {
    const bool is_not_ours = error.code() == ErrorCode::kInvalidInput;
    const bool is_unreadable =
        error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kUnsupportedVersion;
    // A file that is not a job store is replaced only if an earlier build used the folder.
    if (!run.restart || !(is_unreadable || (is_not_ours && work.existed_before()))) throw;
  }
  for (const char* suffix : {"", "-wal", "-shm", "-journal"})
    if (files.exists(work.store_path() + suffix)) files.remove(work.store_path() + suffix);
  return open();
}

}  // namespace

std::string work_folder_of(const RunOptions& options) {
  return options.work_folder.empty() ? options.output + ".work" : options.work_folder;
}

BuildJob::BuildJob(const BuildSpec& spec_of_build, BuildScene& scene_of_build,
                   MemoryBudget& budget_of_build, const BuildContext& outside)
    : spec(spec_of_build),
      scene(scene_of_build),
      budget(budget_of_build),
      output_lock(lock_output(outside, spec.run.output, spec.run.lock_wait_s)),
      work(outside, work_folder_of(spec.run), spec.run.lock_wait_s),
      store(open_job_store(outside.files, work, spec.run)),
      progress(outside.progress, *store, work, spec.run.strict, spec.run.checkpoint_interval_s),
      context{outside.files, progress, outside.cancel},
      checkpoint(spec, store.get(), work, context),
      start_over(spec.run.restart) {
  if (!spec.run.cache_folder.empty())
    cache.emplace(context.files, spec.run.cache_folder, spec.run.cache_bytes);
  report.output = spec.run.output;
  report.scenes = reported_scenes(spec);
  report.hash_bits = spec.geometry.hash_bits;
  report.rule = spec.geometry.rule();
  report.node_order = spec.geometry.order;
  report.threads = spec.run.threads;
  report.memory_bytes = spec.run.memory_bytes;
}

std::vector<StoredSubvolume> BuildJob::planned() const {
  std::vector<StoredSubvolume> leaves = store->leaves();
  std::erase_if(leaves,
                [](const StoredSubvolume& s) { return s.state != SubvolumeState::kPlanned; });
  return leaves;
}

bool BuildJob::has_rows() const {
  if (!rows) return false;
  if (!rows->is_ready())
    throw Error(ErrorCode::kCorrupt,
                work.rows_path() +
                    ": the sample rows of this solid are missing or damaged: start "
                    "over with " +
                    option_text("restart"));
  return true;
}

void BuildJob::commit_best_effort() {
  try {
    commits.commit();
  } catch (const std::exception&) {
  }
}

void BuildJob::refuse(const std::string& difference) const {
  const std::string folder = option_text("work");
  throw Error(ErrorCode::kInvalidInput,
              "the work folder " + work.path() + " holds another job: " + difference +
                  "; start over with " + option_text("restart") +
                  (folder.empty() ? "" : ", or give another folder with " + folder));
}

}  // namespace voxdag
