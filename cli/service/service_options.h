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
  void declare(CLI::App& command);
  // Calls `action` with a client of the server. Throws Error{kInvalidInput} for a malformed URL or
  // token file, and Error{kIo} for an answer that is not what docs/api.md says.
  void with_service(CommandContext& context,
                    const std::function<void(ServiceClient&)>& action) const;

 private:
  client::ClientOptions client_options(FileSystem& files) const;

  std::string url_, token_file_, ca_file_;
};

}  // namespace voxdag::cli
