#include "scheduler/stages/reorder/reorder_stage.h"

#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "query/reorder/order_levels.h"

namespace voxdag {
namespace {

// Id of the stage's first scratch file. The same folder can still have scratch files of the merge.
// Their ids are smaller.
constexpr uint32_t kFirstScratchId = uint32_t{1} << 30;

}  // namespace

void reorder_levels(BuildJob& job, GlobalFileWriter& merged, GlobalFileWriter& out) {
  BuildReport& report = job.report;
  merged.seal({.voxels = report.merge.voxels, .svo_nodes = report.merge.svo_nodes}, report.threads,
              job.context.cancel);
  ScratchFolder scratch(job.context.files, job.work.scratch_path());
  scratch.set_next_id(kFirstScratchId);
  const auto file = open_global_file(merged.path() + ".partial");
  const WatchedFile watched(*file);
  watched.run([&] {
    query::order_levels(*file, NodeOrder::kByFirstParent,
                        {scratch, job.budget, job.budget.available()}, out, job.context.progress,
                        job.context.cancel);
    watched.check_readable();
  });
  report.spill_bytes += scratch.bytes_written();
  job.clock.finish("reorder");
}

}  // namespace voxdag
