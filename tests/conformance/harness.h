// The common part of the conformance tests: the backends under test, and functions that build a
// subvolume and store its result. To test another backend, add a row to backends_under_test();
// every test runs for every row.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "core/backend/backend.h"
#include "tests/oracle/core_types.h"
#include "tests/oracle/scenes.h"

namespace voxdag {

struct BackendUnderTest {
  std::string name;
  std::function<std::unique_ptr<Backend>()> open;
  Simd simd = Simd::kNone;  // instruction set that the backend needs
  friend std::ostream& operator<<(std::ostream& out, const BackendUnderTest& b) {
    return out << b.name;
  }
};
std::vector<BackendUnderTest> backends_under_test();

class Conformance : public testing::TestWithParam<BackendUnderTest> {
 protected:
  void SetUp() override {
    if (!cpu_supports(GetParam().simd))
      GTEST_SKIP() << GetParam().name << ": this machine, or this build, lacks the instruction set";
  }
  std::unique_ptr<Backend> open() const { return GetParam().open(); }
};

#define VOXDAG_FOR_ALL_BACKENDS(fixture)                                                \
  INSTANTIATE_TEST_SUITE_P(Backends, fixture, testing::ValuesIn(backends_under_test()), \
                           [](const auto& row) { return row.param.name; })

constexpr uint64_t kAmpleBudget = uint64_t{1} << 30;

struct Built {
  BuildOutcome outcome = BuildOutcome::kBuilt;
  SubDag dag;
  SubDagSummary summary;
  bool sink_called = false;
};

// Builds a subvolume, and checks the guarantees of a backend for every outcome: it calls the sink
// in order, only if the subvolume is built, and releases all memory.
Built build(Backend& backend, const SubvolumeTask& task, TriangleStream& stream,
            uint64_t budget_bytes = kAmpleBudget);
Built build(Backend& backend, const SubvolumeTask& task, const oracle::Triangles& triangles,
            uint64_t budget_bytes = kAmpleBudget);

// Checks that the sub-DAG's arrays and the summary equal the oracle's.
void expect_equals(const Built& built, const oracle::Dag& truth, const SubvolumeTask& task);
// Builds with the backend and with the oracle, and compares the results.
void expect_right(Backend& backend, const SubvolumeTask& task, const oracle::Triangles& triangles);

// Returns the voxels that a sub-DAG of `cube` sets in a region of the cube. The region consists of
// complete bricks.
oracle::Voxels voxels_of(const SubDag& dag, const Cube& cube, uint32_t grid_levels,
                         const oracle::Region& region);

}  // namespace voxdag
