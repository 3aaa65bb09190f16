#include "cli/modules/load_module.h"

// Hides these functions from the module, which has functions of the same names.
#pragma GCC visibility push(hidden)

namespace voxdag::client {

std::unique_ptr<HttpConnection> open_http(const ClientOptions& options) {
  return cli::module<cli::HttpModule>().open_http(options);
}
bool supports_https() { return cli::module<cli::HttpModule>().supports_https(); }

}  // namespace voxdag::client

#pragma GCC visibility pop
