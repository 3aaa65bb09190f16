#include "server/jobs/protocol/job_request.h"

#include "core/fields/json_fields.h"
#include "server/base/json_text.h"
#include "server/base/request_error.h"

namespace voxdag::server {
namespace {

// Parses the body of a request into `options`. Returns the body as JSON.
template <class Options>
FieldJson read_body(std::string_view body, Options& options) {
  FieldJson json = FieldJson::parse(body, nullptr, false);
  if (json.is_discarded())
    throw RequestError(RequestError::Kind::kInvalid,
                       "the body is not JSON: expected a JSON object");
  set_options(json, "the body", options);
  return json;
}

// Runs `parse`, and throws its errors as RequestError{kInvalid}.
auto as_request(const auto& parse) {
  try {
    return parse();
  } catch (const FieldError& error) {
    throw RequestError(RequestError::Kind::kInvalid, error.message());
  }
}

}  // namespace

JobPatch parse_job_patch(std::string_view body) {
  return as_request([&] {
    JobPatch patch;
    read_body(body, patch);
    return patch;
  });
}

JobRequest parse_job_request(std::string_view body) {
  return as_request([&] {
    JobRequest request;
    const FieldJson json = read_body(body, request);
    check_options(request.spec);
    FieldJson stored = {{"scene", request.scenes},
                        {"resolution", request.spec.geometry.resolution},
                        {"options", json.value("options", FieldJson::object())}};
    if (!request.labels.empty()) stored["labels"] = request.labels;
    request.text = json_text(stored);
    return request;
  });
}

}  // namespace voxdag::server
