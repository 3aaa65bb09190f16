#include "server/api/answers/public_problem.h"

#include <gtest/gtest.h>

#include "server/base/request_error.h"

namespace voxdag::server {
namespace {

// Each kind of error has the status and the code that docs/errors.md and docs/api.md list.
TEST(PublicProblem, HasTheStatusAndCodeOfItsKind) {
  using Kind = RequestError::Kind;
  struct Row {
    Kind kind;
    int status;
    const char* code;
  };
  for (const auto& [kind, status, code] :
       {Row{Kind::kInvalid, 400, "invalid_input"}, Row{Kind::kNotFound, 404, "not_found"},
        Row{Kind::kLimit, 422, "limit"}, Row{Kind::kConflict, 409, "conflict"},
        Row{Kind::kKeyReused, 422, "idempotency_mismatch"}, Row{Kind::kBusy, 503, "busy"}}) {
    SCOPED_TRACE(code);
    const RequestError error(kind, "the reason");
    const Problem problem = public_problem(error);
    EXPECT_EQ(problem.status, status);
    EXPECT_EQ(problem.code, code);
    EXPECT_STREQ(error.code(), code);
    EXPECT_EQ(problem.detail, "the reason");
  }
}

TEST(PublicProblem, CarriesWhatAClientNeedsToContinue) {
  RequestError conflict(RequestError::Kind::kConflict, "no");
  EXPECT_TRUE(public_problem(conflict).headers.empty());
  conflict.job_state = "running";
  conflict.upload_offset = 5;
  const Problem problem = public_problem(conflict);
  EXPECT_EQ(problem.state, "running");
  EXPECT_EQ(header_value(problem.headers, "Upload-Offset"), "5");
  const Problem full = public_problem(RequestError(RequestError::Kind::kBusy, "full"));
  EXPECT_EQ(header_value(full.headers, "Retry-After"), "60");
}

}  // namespace
}  // namespace voxdag::server
