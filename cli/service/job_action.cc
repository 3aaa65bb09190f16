#include "cli/service/job_action.h"

#include <cstdio>
#include <memory>
#include <vector>

#include "cli/service/job_text.h"

namespace voxdag::cli {
namespace {

struct DeedCommand {
  ServerOptions server;
  std::vector<std::string> ids;
  bool json = false;
};

}  // namespace

Json post_verb(Server& server, const std::string& id, const std::string& verb) {
  const std::string path = job_path(id) + "/" + verb;
  return Json::parse(
      server.ask([&](client::HttpClient& http) { return http.send("POST", path, ""); }).body);
}

void add_job_action_command(CLI::App& app, CommandContext& context, const std::string& name,
                            const std::string& description, const JobAction& action) {
  CLI::App* command = app.add_subcommand(name, description);
  const auto state = std::make_shared<DeedCommand>();
  command->add_option("id", state->ids, "the job's id; several may be given")->required();
  state->server.declare(*command);
  command->add_flag("--json", state->json, "each job as one JSON object on standard output");
  command->callback([state, action, &context] {
    with_server(state->server, context, [&](Server& server) {
      for (const std::string& id : state->ids) {
        const Json job = action(server, id);
        std::printf("%s\n", state->json ? job.dump().c_str() : state_line(job).c_str());
      }
    });
  });
}

}  // namespace voxdag::cli
