#include "merge/merge.h"

#include "merge/load/scratch.h"
#include "merge/merger.h"
#include "merge/plan/merge_memory.h"

namespace voxdag {

MergeReport merge_sub_dags(const MergeInputs& inputs, FileSystem& files, GlobalFileWriter& out,
                           MemoryBudget& budget, unsigned threads, Progress& progress,
                           const CancelToken& cancel, Checkpoint* checkpoint) {
  MergeReport report;
  if (inputs.artifacts.empty()) return report;
  MergeScratch scratch(files, inputs.scratch_folder);
  MergeProgress rows_swept(progress);
  const MergeContext context{scratch,    budget, MergeMemory::divide(budget.available(), threads),
                             rows_swept, cancel, report};
  Merger(inputs, context, checkpoint).run(out);
  report.scratch_bytes += scratch.bytes_written();
  return report;
}

}  // namespace voxdag
