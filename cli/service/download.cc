#include "client/result_download.h"

#include <cstdio>

#include "cli/service/service_options.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/text.h"

namespace voxdag::cli {
namespace {

struct DownloadCommand {
  ServiceOptions service;
  std::string id, output;
  bool json = false;
};

void run(const DownloadCommand& command, ServiceClient& service, CommandContext& context) {
  const auto progress = make_progress_bar();
  const client::DownloadResult result = client::download_result(
      service, context.files, service.job(command.id), command.output, *progress);
  if (command.json) {
    const Json report = {{"output", command.output},
                         {"bytes", result.bytes},
                         {"resumed_bytes", result.resumed_bytes},
                         {"sha256", result.sha256}};
    std::printf("%s\n", report.dump().c_str());
  } else {
    std::printf("%s: %s, sha256 %s\n", command.output.c_str(), size_text(result.bytes).c_str(),
                result.sha256.c_str());
  }
}

void declare(Command& command, DownloadCommand& state) {
  command.option("id", state.id, "job id").required();
  command.option("-o,--output", state.output, "the .vdag file to write").required();
  state.service.declare(command);
  command.json_flag(state.json);
}

}  // namespace

void add_download_command(CommandLine& line) {
  add_service_command<DownloadCommand>(line, "download", "download the result of a job of a server",
                                       declare, run);
}

}  // namespace voxdag::cli
