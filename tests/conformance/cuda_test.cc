// If the machine has a CUDA device, the CUDA backend is tested. If it has none, the error must
// state why no device can be opened.
#include "core/base/error.h"
#include "tests/conformance/harness.h"

namespace voxdag {
namespace {

TEST(Cuda, WithoutADeviceItSaysWhy) {
  if (cuda_device_available()) GTEST_SKIP() << "this machine has a CUDA device";
  EXPECT_NE(cuda_device_problem().find("CUDA"), std::string::npos);
  try {
    make_cuda_backend();
    FAIL() << "it opened";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kDevice);
    EXPECT_EQ(error.message(), cuda_device_problem());
  }
}

TEST(Cuda, IsUnderTest) {
  if (!cuda_device_available()) GTEST_SKIP() << "needs a GPU: " << cuda_device_problem();
  EXPECT_EQ(make_cuda_backend()->name(), "cuda");
  EXPECT_THROW(make_cuda_backend(Method::kFast, cuda_device_count()), Error);
}

}  // namespace
}  // namespace voxdag
