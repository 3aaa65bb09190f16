// At any disk operation, a build that leaves out cutouts is killed or loses power, or its disk
// becomes full or fails. The next build gives the same bytes.
#include "tests/crash/crash_fixture.h"
#include "tests/unit/scheduler/cutout_scene.h"

namespace crash {
namespace {

class CutoutsCrashTest : public CrashTest {
 protected:
  void SetUp() override {
    voxdag::write_leaf_image(folder_.path(), 3);
    scene_ = voxdag::write_leaves(folder_.path(), is_durable() ? 10000 : 1000);
    expected_ = run(voxdag::system_files()).sha256;
    std::filesystem::remove(output());
  }
  BuildSpec spec() const override {
    BuildSpec spec = CrashTest::spec();
    spec.geometry.scenes = {scene_};
    spec.geometry.resolution = 128;
    spec.run.subvolume_edge = 64;
    spec.geometry.cutouts = voxdag::CutoutRule::kSkip;
    return spec;
  }

 private:
  std::string scene_;
};

TEST_P(CutoutsCrashTest, KilledAtAnyOperation) { kill_at_any_operation(); }

TEST_P(CutoutsCrashTest, DiskFullOrBroken) { break_disk_at_any_operation(); }

INSTANTIATE_TEST_SUITE_P(Ingested, CutoutsCrashTest,
                         testing::Values(Ingested::kInMemory, Ingested::kDurable), name_of);

}  // namespace
}  // namespace crash
