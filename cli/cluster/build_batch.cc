#include <cstdio>

#include "cli/command.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/text.h"
#include "scheduler/slurm/run_batch.h"

namespace voxdag::cli {
namespace {

struct BuildBatchCommand {
  BatchRun run;
  std::string memory;
};

void run(const BuildBatchCommand& command, CommandContext& context) {
  BatchRun batch = command.run;
  batch.program = VOXDAG_VERSION;
  if (!command.memory.empty()) batch.memory_bytes = parse_size(command.memory, "--memory");
  const auto progress = make_progress_bar();
  const CompletionRecord record = run_batch(batch, {context.files, *progress, context.cancel});
  std::printf("batch %u: %zu subvolumes, %s nodes, %s, %s wall, %s CPU, peak memory %s\n",
              record.batch, record.subvolumes.size(), count_text(record.rows_after).c_str(),
              size_text(record.segment_bytes).c_str(), duration_text(record.wall_s).c_str(),
              duration_text(record.cpu_s).c_str(), size_text(record.peak_rss_bytes).c_str());
}

void declare(Command& command, BuildBatchCommand& state) {
  command.option("work", state.run.work_folder, "the work folder of the build").required();
  command.option("--batch", state.run.batch, "the number of the batch").required();
  command.option("--memory", state.memory,
                 "memory budget (default: the Slurm allocation, otherwise half the RAM)");
  command.threads_option(state.run.threads);
  command.option("--temporary", state.run.temporary_folder,
                 "folder on this machine for temporary files (default: $TMPDIR or /tmp)");
}

}  // namespace

void add_build_batch_command(CommandLine& line) {
  add_command<BuildBatchCommand>(line, "build-batch",
                                 "build one batch of a cluster build (started by its engine)");
}

}  // namespace voxdag::cli
