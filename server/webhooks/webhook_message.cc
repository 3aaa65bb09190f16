#include "server/webhooks/webhook_message.h"

#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/fields/json_text.h"
#include "server/base/printable_json.h"
#include "server/base/time_text.h"

namespace voxdag::server {
namespace {

using nlohmann::ordered_json;

// Returns the members `names` of a JSON text; null for a missing member or a text that is not an
// object.
ordered_json members_of(const std::string& text, const std::vector<const char*>& names) {
  const ordered_json json = try_parse_json<ordered_json>(text);
  ordered_json members = ordered_json::object();
  for (const char* name : names)
    members[name] = json.is_object() && json.contains(name) ? json[name] : ordered_json();
  return members;
}

}  // namespace

std::string webhook_url_of(const Job& job) {
  if (job.request.find("\"webhook\"") == std::string::npos) return "";
  const ordered_json url = members_of(job.request, {"webhook"})["webhook"];
  return url.is_string() ? url.get<std::string>() : "";
}

std::string webhook_body(const std::string& id, const Job& job, const JobEvent& end) {
  const ordered_json labels = members_of(job.request, {"labels"})["labels"];
  ordered_json body = {{"delivery", id},
                       {"id", job.id},
                       {"name", job.name},
                       {"labels", labels.is_array() ? labels : ordered_json::array()},
                       {"state", state_name(end.state)},
                       {"at", time_text(end.at_s)},
                       {"error", nullptr},
                       {"result", nullptr}};
  if (end.state == JobState::kFailed && !end.error.empty()) body["error"] = end.error;
  if (end.state == JobState::kSucceeded && !job.result.empty())
    body["result"] = members_of(job.result, {"sha256", "bytes"});
  make_printable(body);
  return json_text(body);
}

std::string webhook_signature(const std::string& secret, const std::string& body) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned size = 0;
  if (!HMAC(EVP_sha256(), secret.data(), static_cast<int>(secret.size()),
            reinterpret_cast<const unsigned char*>(body.data()), body.size(), digest, &size))
    throw Error(ErrorCode::kIo, "libcrypto computes no HMAC-SHA256: expected one");
  return "sha256=" + hex_text({digest, size});
}

}  // namespace voxdag::server
