// Failing calls of the CUDA runtime. Each call fails in turn, once. The build must then give the
// right result, or an error that names the failure, and the backend must remain usable.
#include "tests/cuda_sim/sim/faults.h"

#include "core/base/error.h"
#include "tests/conformance/harness.h"

namespace voxdag {
namespace {

using Faults = Conformance;
VOXDAG_FOR_ALL_BACKENDS(Faults);

const SubvolumeTask kTask{6, {0, {0, 0, 0}}, 64};

oracle::Triangles scene() {
  return oracle::make_scene(oracle::SceneKind::kSpanning, 5, oracle::region_of(kTask.cube, 6), 6);
}

// Builds with a planned failure, and checks the outcome. Returns true if the failure happened, that
// is, if the build made enough calls of this kind.
bool build_with(Backend& backend, const cuda_sim::Fault& fault, const oracle::Dag& truth) {
  cuda_sim::plan_fault(fault);
  try {
    const Built built = build(backend, kTask, scene());
    if (built.outcome == BuildOutcome::kBuilt) {
      expect_equals(built, truth, kTask);
      EXPECT_FALSE(cuda_sim::fault_happened() && fault.call == cuda_sim::Call::kOther)
          << "a failed call was ignored";
    } else {
      EXPECT_EQ(fault.status, cudaErrorMemoryAllocation);
      EXPECT_EQ(built.outcome, BuildOutcome::kNeedsSplit);
    }
    if (cuda_sim::fault_happened() && fault.call == cuda_sim::Call::kAllocation) {
      EXPECT_EQ(built.outcome, fault.sticky ? BuildOutcome::kNeedsSplit : BuildOutcome::kBuilt);
    }
  } catch (const Error& error) {
    EXPECT_EQ(fault.status, cudaErrorLaunchFailure) << error.what();
    EXPECT_EQ(error.code(), ErrorCode::kDevice);
    EXPECT_NE(std::string(error.what()).find("unspecified launch failure"), std::string::npos);
  }
  const bool happened = cuda_sim::fault_happened();
  cuda_sim::plan_no_fault();
  return happened;
}

oracle::Dag expected() {
  return oracle::build_dag(oracle::voxelize(scene(), oracle::region_of(kTask.cube, 6)), 64);
}

// If one allocation fails, the backend returns the pool's unused memory to the device and succeeds.
// If all further allocations also fail, the backend requests a split.
TEST_P(Faults, EveryAllocation) {
  const auto backend = open();
  const oracle::Dag truth = expected();
  for (const bool sticky : {false, true}) {
    uint64_t n = 0;
    while (build_with(*backend, {cuda_sim::Call::kAllocation, n, cudaErrorMemoryAllocation, sticky},
                      truth)) {
      if (HasFailure()) FAIL() << "when allocation " << n << " fails";
      ++n;
    }
    EXPECT_GT(n, 10u);
    expect_equals(build(*backend, kTask, scene()), truth, kTask);
  }
}

TEST_P(Faults, EveryOtherCall) {
  const auto backend = open();
  const oracle::Dag truth = expected();
  uint64_t n = 0;
  for (; build_with(*backend, {cuda_sim::Call::kOther, n}, truth); ++n)
    if (HasFailure()) FAIL() << "when call " << n << " fails";
  EXPECT_GT(n, 50u);
  expect_equals(build(*backend, kTask, scene()), truth, kTask);
}

// A failed release does not change the result.
TEST_P(Faults, EveryRelease) {
  const auto backend = open();
  const oracle::Dag truth = expected();
  uint64_t n = 0;
  for (; build_with(*backend, {cuda_sim::Call::kRelease, n}, truth); ++n)
    if (HasFailure()) FAIL() << "when release " << n << " fails";
  EXPECT_GT(n, 5u);
}

// If a call fails while a backend is opened, the error names the reason, and the next backend can
// be opened.
TEST_P(Faults, EveryCallOfOpening) {
  const oracle::Dag truth = expected();
  for (const cuda_sim::Fault& kind :
       {cuda_sim::Fault{cuda_sim::Call::kAllocation, 0, cudaErrorMemoryAllocation, false},
        cuda_sim::Fault{cuda_sim::Call::kOther, 0, cudaErrorLaunchFailure, false}}) {
    uint64_t n = 0;
    for (bool happened = true; happened; ++n) {
      cuda_sim::Fault fault = kind;
      fault.skipped = n;
      cuda_sim::plan_fault(fault);
      std::unique_ptr<Backend> opened;  // closed without a fault
      try {
        opened = open();
        EXPECT_FALSE(cuda_sim::fault_happened()) << "call " << n << " was ignored";
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kDevice) << error.what();
      }
      happened = cuda_sim::fault_happened();
      cuda_sim::plan_no_fault();
    }
    EXPECT_GT(n, 3u);
  }
  expect_equals(build(*open(), kTask, scene()), truth, kTask);
}

TEST_P(Faults, ADeviceThatStaysBroken) {
  const auto backend = open();
  const oracle::Dag truth = expected();
  for (uint64_t n = 0;
       build_with(*backend, {cuda_sim::Call::kOther, n, cudaErrorLaunchFailure, true}, truth);
       n += 7)
    if (HasFailure()) FAIL() << "from call " << n << " on";
  expect_equals(build(*backend, kTask, scene()), truth, kTask);
}

// A backend that is closed after a failure waits for the copies that still use its pinned memory.
TEST_P(Faults, ClosedAfterAnyFailure) {
  const oracle::Dag truth = expected();
  for (uint64_t n = 0;; n += 3) {
    const auto backend = open();
    if (!build_with(*backend, {cuda_sim::Call::kOther, n, cudaErrorLaunchFailure, true}, truth))
      break;
    if (HasFailure()) FAIL() << "from call " << n << " on";
  }
}

}  // namespace
}  // namespace voxdag
