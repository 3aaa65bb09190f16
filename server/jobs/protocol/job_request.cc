#include "server/jobs/protocol/job_request.h"

#include "core/fields/json_text.h"
#include "server/jobs/protocol/request_body.h"

namespace voxdag::server {
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
    if (!request.webhook.empty()) stored["webhook"] = request.webhook;
    request.text = json_text(stored);
    return request;
  });
}

}  // namespace voxdag::server
