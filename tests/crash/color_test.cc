// At any disk operation, a build with colors and all other attributes is killed or loses power, or
// its disk becomes full or fails. The next build gives the same bytes.
#include <array>
#include <set>

#include "scheduler/stages/attributes/color_store.h"
#include "tests/crash/crash_fixture.h"
#include "tests/unit/scheduler/stages/attributes/painted_scene.h"

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
    spec.geometry.attributes = voxdag::AttributeSet::all();
    return spec;
  }

 private:
  std::string scene_;
};

TEST_P(ColorCrashTest, KilledAtAnyOperation) { kill_at_any_operation(); }

TEST_P(ColorCrashTest, DiskFullOrBroken) { break_disk_at_any_operation(); }

// If a fault interrupts ColorStore::keep_only(), either all unwanted artifacts are removed or none
// is removed. The wanted artifact remains.
TEST(ColorStoreCrash, KeepsWhatIsWanted) {
  const voxdag::TemporaryFolder folder;
  const std::string path = folder.file("colors.vddurable");
  const voxdag::Checksum128 wanted{1, 1}, garbage{2, 2};
  const std::vector<std::byte> small(1000, std::byte{1}), large(3 << 20, std::byte{2});
  Warnings warnings;
  const voxdag::CancelToken cancel;
  const auto open = [&](voxdag::FileSystem& files) {
    return voxdag::ColorStore(files, path, 0, warnings, cancel);
  };
  const auto drop = [&](FaultPlan plan) {
    const pid_t child = fork();
    if (child == 0) {
      FaultyFiles files(plan);
      open(files).keep_only(std::array{wanted}, cancel);
      _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    return WIFSIGNALED(status);
  };
  std::set<bool> outcomes;  // true if the garbage remains
  for (const Fault fault :
       {Fault::kKillBefore, Fault::kKillAfter, Fault::kPowerCut, Fault::kNoSpace})
    for (uint64_t at = 1;; ++at) {
      std::filesystem::remove(path);
      {
        voxdag::ColorStore store = open(voxdag::system_files());
        store.add(wanted, 0, true, small);
        store.add(garbage, 0, true, large);
      }
      const bool was_killed = drop({fault, at});
      const voxdag::ColorStore store = open(voxdag::system_files());
      ASSERT_TRUE(store.has(wanted)) << static_cast<int>(fault) << " at " << at;
      outcomes.insert(store.has(garbage));
      EXPECT_EQ(std::filesystem::file_size(path), store.file_bytes());
      if (fault == Fault::kNoSpace ? at == 4 : !was_killed) break;
    }
  EXPECT_EQ(outcomes.size(), 2u);
  EXPECT_EQ(warnings.last, "");
}

INSTANTIATE_TEST_SUITE_P(Ingested, ColorCrashTest, testing::Values(Ingested::kInMemory), name_of);

}  // namespace
}  // namespace crash
