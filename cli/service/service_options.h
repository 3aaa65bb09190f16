// The options of all client commands: --server, --token-file and --ca-file.
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
  // Calls `action` with a client for the server that the options name. Throws Error{kInvalidInput}
  // for a malformed URL or token file, Error{kIo} if an answer does not conform to docs/api.md, and
  // the errors of `action`.
  void with_service(CommandContext& context,
                    const std::function<void(ServiceClient&)>& action) const;

 private:
  client::ClientOptions client_options(FileSystem& files) const;

  std::string url_, token_file_, ca_file_;
};

// Adds a client command, as add_command() adds other commands. `State` has a member `service` of
// the type ServiceOptions. The caller's file must define declare(command, state), as for
// add_command(), and run(state, client, context). `client` is connected to the server that the
// options name. Users can shorten the job ids in the members `id` and `ids` of `State`; run() gets
// the complete ids.
template <class State>
State& add_service_command(CommandLine& line, const char* name, const char* description) {
  Command command = line.add(name, description);
  const auto state = std::make_shared<State>();
  declare(command, *state);
  command.on_run([state, &line] {
    state->service.with_service(line.context(), [&](ServiceClient& service) {
      if constexpr (requires { state->id; }) state->id = service.full_id(state->id);
      if constexpr (requires { state->ids; })
        for (std::string& id : state->ids) id = service.full_id(id);
      run(*state, service, line.context());
    });
  });
  return *state;
}

}  // namespace voxdag::cli
