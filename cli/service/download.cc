#include <cstdio>

#include "cli/output.h"
#include "cli/service/service_options.h"
#include "cli/terminal/progress_bar.h"
#include "client/result_download.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/format/global/global_writer.h"

namespace voxdag::cli {
namespace {

struct DownloadCommand {
  ServiceOptions service;
  std::string id;
  OutputFile output;
  bool quiet = false;
  bool json = false;
};

void run(const DownloadCommand& command, ServiceClient& service, CommandContext& context) {
  GuardedOutputs files(context.files);
  command.output.guard(files);
  command.output.check(files, command.output.path, "", is_global_file);
  const auto progress = make_progress_bar(command.quiet);
  const client::DownloadResult result = client::download_result(
      service, files, service.job(command.id), command.output.path, *progress);
  if (command.json) {
    print_json(Json{{"output", command.output.path},
                    {"bytes", result.bytes},
                    {"resumed_bytes", result.resumed_bytes},
                    {"sha256", result.sha256}});
  } else {
    std::printf("%s: %s, sha256 %s\n", printable_line(command.output.path).c_str(),
                size_text(result.bytes).c_str(), result.sha256.c_str());
  }
}

void declare(Command& command, DownloadCommand& state) {
  command.option("id", state.id, "job id").required();
  command.output_option("-o,--output", state.output.path, "the .vdag file to write").required();
  state.service.declare(command);
  state.output.declare_force(command);
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_download_command(CommandLine& line) {
  add_service_command<DownloadCommand>(line, "download",
                                       "download the result of a job of a server");
}

}  // namespace voxdag::cli
