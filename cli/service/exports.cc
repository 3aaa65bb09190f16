// The command exports: lists and deletes the exports of a job.
#include <cstdio>
#include <vector>

#include "cli/output.h"
#include "cli/service/service_options.h"
#include "client/remote_export.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"

namespace voxdag::cli {
namespace {

struct ExportsCommand {
  ServiceOptions service;
  std::string id;
  std::vector<std::string> deleted;  // ids of exports
  bool json = false;
};

void print_exports(const Json& exports) {
  std::printf("%-16s  %-10s  %-8s  %10s  %s\n", "EXPORT", "STATE", "FORMAT", "SIZE", "FILES");
  for (const Json& it : exports) {
    uint64_t bytes = 0;
    std::string names;
    for (const Json& file : it.at("files")) {
      bytes += file.at("bytes").get<uint64_t>();
      names += (names.empty() ? "" : ", ") + file.at("name").get<std::string>();
    }
    if (it.at("error").is_object()) names = it.at("error").at("message").get<std::string>();
    const auto text = [](const Json& member) { return printable_line(member.get<std::string>()); };
    std::printf("%-16s  %-10s  %-8s  %10s  %s\n", text(it.at("id")).c_str(),
                text(it.at("state")).c_str(), text(it.at("request").at("to")).c_str(),
                bytes ? size_text(bytes).c_str() : "", printable_line(names).c_str());
  }
}

void run(const ExportsCommand& command, ServiceClient& service, CommandContext&) {
  Json states = Json::object();
  for (const std::string& id : command.deleted)
    states[id] = client::delete_export(service, command.id, id) ? "deleted" : "deleting";
  if (command.deleted.empty()) {
    const Json exports = client::exports_of(service, command.id);
    if (command.json) return print_json(Json{{"exports", exports}});
    return print_exports(exports);
  }
  if (command.json) return print_json(states);
  for (const auto& [id, state] : states.items())
    std::printf("export %s: %s\n", id.c_str(), state.get<std::string>().c_str());
}

void declare(Command& command, ExportsCommand& state) {
  command.option("id", state.id, "job id").required();
  command
      .option("--delete", state.deleted,
              "id of an export to delete with its files, or to cancel if it is queued or runs; can "
              "be repeated")
      .one_value_each();
  state.service.declare(command);
  command.json_flag(state.json);
}

}  // namespace

void add_exports_command(CommandLine& line) {
  add_service_command<ExportsCommand>(line, "exports", "list or delete the exports of a job");
}

}  // namespace voxdag::cli
