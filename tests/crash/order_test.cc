// At any disk operation, a build that reorders its nodes is killed or loses power, or its disk
// becomes full or fails. The next build gives the same bytes.
#include "tests/crash/crash_fixture.h"

namespace crash {
namespace {

class OrderCrashTest : public CrashTest {
 protected:
  BuildSpec spec() const override {
    BuildSpec spec = CrashTest::spec();
    spec.geometry.order = voxdag::OrderName::kFirstParent;
    spec.geometry.resolution = 256;
    return spec;
  }
};

TEST_P(OrderCrashTest, KilledAtAnyOperation) { kill_at_any_operation(); }

TEST_P(OrderCrashTest, DiskFullOrBroken) { break_disk_at_any_operation(); }

INSTANTIATE_TEST_SUITE_P(Ingested, OrderCrashTest, testing::Values(Ingested::kInMemory), name_of);

}  // namespace
}  // namespace crash
