// The options that all client commands have: --server, --token-file and --ca-file.
#pragma once

#include <functional>
#include <string>

#include "cli/command.h"
#include "client/service_client.h"

namespace voxdag::cli {

using client::Json;
using client::ServiceClient;

class ServiceOptions {
 public:
  void declare(Command& command);
  // Calls `action` with a client of the server. Throws Error{kInvalidInput} for a malformed URL or
  // token file, and Error{kIo} for an answer that is not what docs/api.md says.
  void with_service(CommandContext& context,
                    const std::function<void(ServiceClient&)>& action) const;

 private:
  client::ClientOptions client_options(FileSystem& files) const;

  std::string url_, token_file_, ca_file_;
};

// Adds a command whose State has a member `service` of these options: run(state, client, context)
// is called with a client of the server.
template <class State, class Declare, class Run>
void add_service_command(CommandLine& line, const char* name, const char* description,
                         Declare declare, Run run) {
  add_command<State>(line, name, description, declare,
                     [run](State& state, CommandContext& context) {
                       state.service.with_service(
                           context, [&](ServiceClient& service) { run(state, service, context); });
                     });
}

}  // namespace voxdag::cli
