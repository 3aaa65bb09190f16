// The body of POST /jobs: the text that is stored for a request parses to the same request.
#include "server/jobs/protocol/job_request.h"

#include <string>

#include "server/base/request_error.h"
#include "tests/fuzz/targets/fuzz_target.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag::server;
  std::string text;
  try {
    text = parse_job_request({reinterpret_cast<const char*>(data), size}).text;
  } catch (const RequestError&) {
    return 0;
  }
  // Outside of try: an error here is a finding.
  voxdag::fuzz::require(parse_job_request(text).text == text,
                        "the stored text parses to the same request");
  return 0;
}
