#include "core/base/error.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace voxdag {
namespace {

struct Row {
  ErrorCode code;
  const char* name;
  int exit_status;
  int http_status;
};

// The table of docs/errors.md, on which scripts and HTTP clients depend.
constexpr Row kPromised[] = {
    {ErrorCode::kInvalidInput, "invalid_input", 2, 400},
    {ErrorCode::kNotFound, "not_found", 3, 404},
    {ErrorCode::kCorrupt, "corrupt", 4, 500},
    {ErrorCode::kUnsupportedVersion, "unsupported_version", 5, 400},
    {ErrorCode::kIo, "io", 6, 500},
    {ErrorCode::kNoSpace, "no_space", 7, 507},
    {ErrorCode::kOutOfMemory, "out_of_memory", 8, 503},
    {ErrorCode::kDevice, "device", 9, 422},
    {ErrorCode::kLimit, "limit", 10, 422},
    {ErrorCode::kCanceled, "canceled", 130, 409},
};

// Names and statuses are a public interface, so this test fails if one of them changes.
TEST(ErrorTable, IsAsPromised) {
  for (const Row& row : kPromised) {
    SCOPED_TRACE(row.name);
    EXPECT_STREQ(error_name(row.code), row.name);
    EXPECT_EQ(exit_status(row.code), row.exit_status);
    EXPECT_EQ(http_status(row.code), row.http_status);
  }
}

// Each error has a different exit status. No error has the status 0 (success), 1, or a status that
// the shell uses (126 and above). The exception is kCanceled, which has the status of Ctrl-C.
TEST(ErrorTable, ExitStatusesAreDistinctAndNotTheShells) {
  std::set<int> seen;
  for (const Row& row : kPromised) {
    const int status = exit_status(row.code);
    EXPECT_TRUE(seen.insert(status).second) << status;
    EXPECT_GT(status, 1);
    EXPECT_TRUE(status < 126 || row.code == ErrorCode::kCanceled) << status;
  }
}

// An Error that is caught as std::exception keeps its message and, after a cast to Error, its code.
TEST(Error, KeepsCodeAndMessage) {
  try {
    throw Error(ErrorCode::kNoSpace, "disk full: spill.bin");
  } catch (const std::exception& caught) {
    EXPECT_STREQ(caught.what(), "disk full: spill.bin");
    const auto* error = dynamic_cast<const Error*>(&caught);
    ASSERT_NE(error, nullptr);
    EXPECT_EQ(error->code(), ErrorCode::kNoSpace);
    EXPECT_EQ(error->message(), "disk full: spill.bin");
  }
}

}  // namespace
}  // namespace voxdag
