#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <utility>

#include "core/base/process_limits.h"
#include "tests/support/lowered_limit.h"

namespace voxdag {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(SystemError, FullDisksQuotasAndFileSizesAreOneCode) {
  for (const int reason : {ENOSPC, EDQUOT, EFBIG})
    EXPECT_EQ(code_of_errno(reason), ErrorCode::kNoSpace) << reason;
  EXPECT_EQ(code_of_errno(ENOENT), ErrorCode::kNotFound);
  EXPECT_EQ(code_of_errno(ENOMEM), ErrorCode::kOutOfMemory);
  EXPECT_EQ(code_of_errno(ENAMETOOLONG), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of_errno(EIO), ErrorCode::kIo);
}

TEST(SystemError, NamesTheLimit) {
  const std::tuple<int, __rlimit_resource, rlim_t, const char*> cases[] = {
      {EFBIG, RLIMIT_FSIZE, 5 << 20, "file sizes, ulimit -f, is 5.00 MiB"},
      {EMFILE, RLIMIT_NOFILE, 200, "open files, ulimit -n, is 200"},
      {EAGAIN, RLIMIT_NPROC, 4000, "processes and threads, ulimit -u, is 4 000"},
  };
  for (const auto& [reason, resource, value, text] : cases) {
    const LoweredLimit lowered(resource, value);
    EXPECT_THAT(errno_text(reason), HasSubstr(text));
    EXPECT_THAT(errno_text(EIO), Not(HasSubstr("limit")));
  }
}

TEST(SystemError, OfTheStandardLibrary) {
  const auto of = [](int reason) {
    return error_of(std::system_error(reason, std::generic_category(), "thread"));
  };
  EXPECT_EQ(of(EAGAIN).code(), ErrorCode::kOutOfMemory);
  EXPECT_THAT(of(EAGAIN).message(), HasSubstr("cannot start a thread"));
  EXPECT_EQ(of(ENOSPC).code(), ErrorCode::kNoSpace);
  EXPECT_EQ(out_of_memory_error().code(), ErrorCode::kOutOfMemory);
}

}  // namespace
}  // namespace voxdag
