// A build with colors that is killed, cut off from power, or has its disk fill up or fail, at any
// operation on the disk, ends with the same bytes when it is run again.
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
    spec.geometry.color = true;
    return spec;
  }

 private:
  std::string scene_;
};

TEST_P(ColorCrashTest, KilledAtAnyOperation) {
  const uint64_t operations = operations_of_a_build();
  for (const Fault fault : {Fault::kKillBefore, Fault::kKillAfter, Fault::kPowerCut}) {
    uint64_t kills = 0;
    for (const uint64_t at : moments(operations)) {
      SCOPED_TRACE(testing::Message() << "fault " << static_cast<int>(fault) << " at operation "
                                      << at << " of " << operations);
      kills += killed({fault, at});
      expect_to_resume();
    }
    EXPECT_GT(kills, 0u);
  }
}

TEST_P(ColorCrashTest, DiskFullOrBroken) {
  const uint64_t operations = operations_of_a_build();
  for (const Fault fault : {Fault::kNoSpace, Fault::kIoError})
    for (const uint64_t at : moments(operations)) {
      SCOPED_TRACE(testing::Message() << "fault " << static_cast<int>(fault) << " from operation "
                                      << at << " of " << operations);
      FaultyFiles files({fault, at});
      try {
        run(files);
        EXPECT_TRUE(std::filesystem::exists(output()));
        std::filesystem::remove_all(output() + ".work");
      } catch (const voxdag::Error& error) {
        EXPECT_EQ(error.code(),
                  fault == Fault::kNoSpace ? voxdag::ErrorCode::kNoSpace : voxdag::ErrorCode::kIo)
            << error.what();
      }
      expect_to_resume();
    }
}

INSTANTIATE_TEST_SUITE_P(Ingested, ColorCrashTest, testing::Values(Ingested::kInMemory), name_of);

}  // namespace
}  // namespace crash
