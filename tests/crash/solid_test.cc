// At any disk operation, a build of a solid is killed or loses power, or its disk becomes full or
// fails. The next build gives the same bytes and the same report of the interior.
#include "tests/crash/crash_fixture.h"

namespace crash {
namespace {

class SolidCrashTest : public CrashTest {
 protected:
  // Spheres are closed, so the build does not warn.
  void SetUp() override {
    voxdag::GenerateOptions options;
    options.kind = voxdag::SceneKind::kSpheres;
    options.triangles = is_durable() ? 20000 : 3000;
    voxdag::NoProgress progress;
    voxdag::CancelToken cancel;
    voxdag::generate_scene(voxdag::system_files(), folder_.file("scene.glb"), options, progress,
                           cancel);
    expected_ = run(voxdag::system_files()).sha256;
    std::filesystem::remove(output());
  }
  BuildSpec spec() const override {
    BuildSpec spec = CrashTest::spec();
    spec.geometry.solid = voxdag::SolidName::kWinding;
    return spec;
  }
};

TEST_P(SolidCrashTest, KilledAtAnyOperation) { kill_at_any_operation(); }

TEST_P(SolidCrashTest, DiskFullOrBroken) { break_disk_at_any_operation(); }

// The stage that fills an enclosed solid is interrupted as well.
class EnclosedCrashTest : public SolidCrashTest {
 protected:
  BuildSpec spec() const override {
    BuildSpec spec = SolidCrashTest::spec();
    spec.geometry.solid = voxdag::SolidName::kEnclosed;
    return spec;
  }
};

TEST_P(EnclosedCrashTest, KilledAtAnyOperation) { kill_at_any_operation(); }

TEST_P(EnclosedCrashTest, DiskFullOrBroken) { break_disk_at_any_operation(); }

// With --radius, the passes over the positions of the cube (docs/solid.md) are interrupted as well.
class RadiusCrashTest : public EnclosedCrashTest {
 protected:
  BuildSpec spec() const override {
    BuildSpec spec = EnclosedCrashTest::spec();
    spec.geometry.radius = 2;
    spec.geometry.resolution = 128;
    spec.run.subvolume_edge = 64;
    return spec;
  }
};

TEST_P(RadiusCrashTest, KilledAtAnyOperation) { kill_at_any_operation(); }

INSTANTIATE_TEST_SUITE_P(Ingested, RadiusCrashTest, testing::Values(Ingested::kDurable), name_of);

INSTANTIATE_TEST_SUITE_P(Ingested, EnclosedCrashTest, testing::Values(Ingested::kDurable), name_of);

INSTANTIATE_TEST_SUITE_P(Ingested, SolidCrashTest,
                         testing::Values(Ingested::kInMemory, Ingested::kDurable), name_of);

}  // namespace
}  // namespace crash
