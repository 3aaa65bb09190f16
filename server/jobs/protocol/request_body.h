// Parses the JSON bodies of requests into structs that have a `fields` function.
#pragma once

#include <string_view>

#include "core/fields/json_fields.h"
#include "core/fields/json_text.h"
#include "server/base/request_error.h"

namespace voxdag::server {

// Parses the body of a request into `options`. Returns the body as JSON. Throws
// RequestError{kInvalid} for a body that is not JSON, and FieldError for a wrong member.
template <class Options>
FieldJson read_body(std::string_view body, Options& options) {
  FieldJson json = try_parse_json<FieldJson>(body);
  if (json.is_discarded())
    throw RequestError(RequestError::Kind::kInvalid,
                       "the body is not JSON: expected a JSON object");
  if (const auto name = repeated_member(body)) json_fields::refuse_repeated(*name);
  set_options(json, "the body", options);
  return json;
}

// Runs `parse`, and throws its field errors as RequestError{kInvalid}.
auto as_request(const auto& parse) {
  try {
    return parse();
  } catch (const FieldError& error) {
    throw RequestError(RequestError::Kind::kInvalid, error.message());
  }
}

}  // namespace voxdag::server
