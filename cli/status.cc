#include <chrono>
#include <cstdio>
#include <thread>

#include "cli/cluster.h"
#include "cli/command.h"
#include "cli/output.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/format/global/global_writer.h"
#include "core/io/overwrite.h"
#include "scheduler/state/job_status.h"
#include "scheduler/state/work_folder.h"

namespace voxdag::cli {
namespace {

struct StatusCommand {
  std::string work_folder;
  bool json = false;
  bool watch = false;
};

void print(const JobStatus& status, FileSystem& files, const std::string& work_folder) {
  std::printf(
      "%s; %s of %s subvolumes built\n",
      status.running ? ("being built by " + printable_line(status.holder)).c_str() : "not running",
      count_text(status.built).c_str(), count_text(status.subvolumes).c_str());
  if (const auto& p = status.progress) {
    std::printf("  stage %s: %s of %s %s, %s/s", printable_line(p->stage).c_str(),
                count_text(p->done).c_str(), count_text(p->total).c_str(),
                printable_line(p->unit).c_str(),
                count_text(static_cast<uint64_t>(status.rate())).c_str());
    if (status.running && status.eta_s() > 0)
      std::printf(", %s left", duration_text(status.eta_s()).c_str());
    std::printf("\n  memory %s, disk %s\n", size_text(p->memory_bytes).c_str(),
                size_text(p->disk_bytes).c_str());
    if (!p->last_error.empty())
      std::printf("  last error: %s\n", printable_line(p->last_error).c_str());
  }
  print_cluster_status(files, work_folder);
  for (const StageTime& stage : status.stages)
    std::printf("  %-10s %s wall, %s CPU\n", printable_line(stage.name).c_str(),
                duration_text(stage.wall_s).c_str(), duration_text(stage.cpu_s).c_str());
}

bool has_build(FileSystem& files, const std::string& work_folder) {
  return files.exists(WorkFolder::store_path(work_folder)) ||
         !WorkFolder::holder(files, work_folder).empty();
}

// Returns the work folder of the given path, which can also be the output of a build.
std::string find_work_folder(FileSystem& files, const std::string& path) {
  if (has_build(files, path)) return path;
  const std::string work_folder = path + ".work";
  if (has_build(files, work_folder)) return work_folder;
  if (files.identify(path) && is_global_file(*files.open_read(path)))
    throw Error(ErrorCode::kNotFound,
                path +
                    ": no build of this file is unfinished: expected a file with the work folder " +
                    work_folder + "; '" + command_text("info") + "' describes a finished file");
  return path;
}

void run(const StatusCommand& given, CommandContext& context) {
  StatusCommand command = given;
  command.work_folder = find_work_folder(context.files, given.work_folder);
  for (bool first = true;; first = false) {
    // The build can finish between two reads of its state. A finished build removes its work
    // folder.
    if (!first && !has_build(context.files, command.work_folder)) return;
    const JobStatus status = read_job_status(context.files, command.work_folder);
    if (command.json)
      print_json_text(status_json(status, cluster_status_json(context.files, command.work_folder)));
    else
      print(status, context.files, command.work_folder);
    std::fflush(stdout);
    if (!command.watch || !status.running) return;
    std::this_thread::sleep_for(std::chrono::seconds(1));
    context.cancel.check();
  }
}

void declare(Command& command, StatusCommand& state) {
  command.option("work", state.work_folder, "the output OUT.vdag of the build, or its work folder")
      .required();
  command.json_flag(state.json);
  command.flag("--watch", state.watch, "repeat every second until the build ends");
}

}  // namespace

void add_status_command(CommandLine& line) {
  add_command<StatusCommand>(line, "status", "print the state and progress of a build");
}

}  // namespace voxdag::cli
