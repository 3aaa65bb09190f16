#include "client/http_client.h"

#include <nlohmann/json.hpp>

#include "core/fields/json_text.h"

namespace voxdag::client {

ErrorCode error_code_of(const std::string& name, int http_status) {
  if (const auto code = error_code_named(name)) return *code;
  return http_status >= 500 ? ErrorCode::kIo : ErrorCode::kInvalidInput;
}

void throw_if_problem(const ClientResponse& response) {
  if (response.status < 400) return;
  const auto json = try_parse_json<nlohmann::json>(response.body);
  std::string code,
      detail = "the server answered with status " + std::to_string(response.status) +
               " and no description of the error, expected one as a voxdag service sends it";
  // Returns the member `name`, or the argument `otherwise` if this member is not a string. The
  // answer can come from another server or a proxy, so its JSON can have any form.
  const auto text = [&](const char* name, const std::string& otherwise) {
    const auto found = json.find(name);
    return found != json.end() && found->is_string() ? found->get<std::string>() : otherwise;
  };
  if (json.is_object()) {
    code = text("code", "");
    detail = text("detail", detail);
    if (error_code_of(code, response.status) == ErrorCode::kInvalidInput && code != "invalid_input")
      detail += " (" + code + ")";
  }
  throw Error(error_code_of(code, response.status), detail);
}

}  // namespace voxdag::client
