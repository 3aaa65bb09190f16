#include "cli/modules/modules.h"

namespace voxdag::cli {

const HttpModule voxdag_http_module = {
    .head = {}, .open_http = &client::open_http, .supports_https = &client::supports_https};

}  // namespace voxdag::cli
