// A build with colors and all other attributes that is killed, cut off from power, or has its disk
// fill up or fail, at any operation on the disk, ends with the same bytes when it is run again.
#include "tests/crash/crash_fixture.h"
#include "tests/unit/scheduler_color/painted_scene.h"

namespace crash {
namespace {

class ColorCrashTest : public CrashTest {
 protected:
  void SetUp() override {
    scene_ = voxdag::PaintedScene::write(folder_.path());
    expected_ = run(voxdag::system_files()).sha256;
    std::filesystem::remove(output());
  }
  BuildSpec spec() const override {
    BuildSpec spec = CrashTest::spec();
    spec.geometry.scenes = {scene_};
    spec.geometry.resolution = 128;
    spec.geometry.attributes = {true, true, true, true};
    return spec;
  }

 private:
  std::string scene_;
};

TEST_P(ColorCrashTest, KilledAtAnyOperation) { kill_at_any_operation(); }

TEST_P(ColorCrashTest, DiskFullOrBroken) { break_disk_at_any_operation(); }

INSTANTIATE_TEST_SUITE_P(Ingested, ColorCrashTest, testing::Values(Ingested::kInMemory), name_of);

}  // namespace
}  // namespace crash
