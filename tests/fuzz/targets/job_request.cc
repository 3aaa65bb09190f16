// Parses the body of POST /jobs. A parsed request has a normalized text, which the service stores.
// Parsing this text must give the same request.
#include "server/jobs/protocol/job_request.h"

#include <string>

#include "server/base/request_error.h"
#include "tests/fuzz/support/fuzz_target.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag::server;
  std::string text;
  try {
    text = parse_job_request({reinterpret_cast<const char*>(data), size}).text;
  } catch (const RequestError&) {
    return 0;
  }
  // This call is outside of `try`, because an error here is a finding.
  voxdag::fuzz::require(parse_job_request(text).text == text,
                        "the stored text parses to the same request");
  return 0;
}
