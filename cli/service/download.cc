#include "client/download.h"

#include <cstdio>
#include <memory>

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

void run(const DownloadCommand& command, FileSystem& files, ServiceClient& service) {
  const auto progress = make_progress_bar();
  const client::DownloadResult result =
      client::download_result(service, files, service.job(command.id), command.output, *progress);
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

}  // namespace

void add_download_command(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("download", "download the result of a job of a server");
  const auto state = std::make_shared<DownloadCommand>();
  command->add_option("id", state->id, "job id")->required();
  command->add_option("-o,--output", state->output, "the .vdag file to write")->required();
  state->service.declare(*command);
  command->add_flag("--json", state->json, "report as one JSON object on standard output");
  command->callback([state, &context] {
    state->service.with_service(
        context, [&](ServiceClient& service) { run(*state, context.files, service); });
  });
}

}  // namespace voxdag::cli
