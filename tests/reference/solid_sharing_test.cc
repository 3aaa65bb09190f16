// Builds of solids whose work is divided (because an enclosed part exceeds the memory) or shared
// (through the cache). The bytes are the same as in other builds of the scene.
#include <array>

#include "tests/oracle/solid/solids.h"
#include "tests/reference/reference_build.h"

namespace reference {
namespace {

using voxdag::BuildReport;
using voxdag::BuildSpec;
using voxdag::SolidName;

constexpr std::array kFillingRules = {SolidName::kWinding, SolidName::kParity,
                                      SolidName::kEnclosed};

// Records the number of parts that the stage `enclose` fills.
class PartsOfEnclose : public voxdag::NoProgress {
 public:
  void begin_stage(std::string_view stage, uint64_t total, std::string_view) override {
    is_enclose_ = stage == "enclose";
    set_total(total);
  }
  void set_total(uint64_t total) override {
    if (is_enclose_) parts = total / 2;
  }
  uint64_t parts = 0;

 private:
  bool is_enclose_ = false;
};

class SolidSharing : public Reference {
 protected:
  // Builds the complete grid as one subvolume.
  BuildReport build_enclosed(BuildSpec spec, uint64_t memory_bytes) {
    spec.geometry.solid = SolidName::kEnclosed;
    spec.run.subvolume_edge = spec.geometry.resolution;
    spec.run.memory_bytes = memory_bytes;
    spec.run.output = folder_.file("part_" + std::to_string(memory_bytes) + ".vdag");
    spec.run.threads = 1;
    progress_.parts = 0;
    return voxdag::run_build(spec, {voxdag::system_files(), progress_, never_});
  }
  PartsOfEnclose progress_;
  voxdag::CancelToken never_;
};

// A subvolume fits in memory while it is built, but the labels of its empty space, which find the
// enclosed parts, do not fit. So its octants are labeled and filled one by one.
TEST_F(SolidSharing, EnclosedPartsAreSplitIntoOctants) {
  Triangles scene = oracle::make_scene(oracle::SceneKind::kSpanning, 3, {{0, 0, 0}, 512}, 120);
  for (const auto& t : oracle::make_solid(oracle::SolidKind::kTorus, 1, 512)) scene.push_back(t);
  const BuildSpec spec = spec_for(scene, 512);
  const BuildReport whole = build_enclosed(spec, 1024 * kMebibyte);
  EXPECT_EQ(whole.subvolumes, 1u);
  EXPECT_EQ(progress_.parts, 1u);
  EXPECT_GT(whole.solid->interior, 0u);
  const BuildReport split = build_enclosed(spec, 64 * kMebibyte);
  EXPECT_EQ(split.subvolumes, 1u);
  EXPECT_GT(progress_.parts, 1u);
  EXPECT_EQ(split.sha256, whole.sha256);
  EXPECT_EQ(split.solid->interior, whole.solid->interior);
}

// Builds of solids by winding and parity share their subvolumes with builds by the same rule. A
// build of an enclosed solid shares its shell with other builds.
TEST_F(SolidSharing, CacheNeverShows) {
  const BuildSpec shell = spec_for(oracle::make_solid(oracle::SolidKind::kNested, 3, 128), 128);
  const auto cached = [&](SolidName rule) {
    BuildSpec spec = shell;
    spec.geometry.solid = rule;
    spec.run.subvolume_edge = 64;
    spec.run.cache_folder = folder_.file("cache");
    return run(spec);
  };
  for (const SolidName rule : kFillingRules) {
    SCOPED_TRACE(static_cast<int>(rule));
    BuildSpec spec = shell;
    spec.geometry.solid = rule;
    const BuildReport expected = run(spec);
    for (int time = 0; time < 2; ++time) {
      const BuildReport report = cached(rule);
      EXPECT_EQ(report.sha256, expected.sha256);
      EXPECT_EQ(report.solid->interior, expected.solid->interior);
      EXPECT_EQ(report.subvolumes_cached, time == 1 ? report.subvolumes : 0);
    }
  }
  const BuildReport of_shell = cached(SolidName::kNone);
  EXPECT_EQ(of_shell.subvolumes_cached, of_shell.subvolumes);
  EXPECT_EQ(of_shell.sha256, run(shell).sha256);
}

}  // namespace
}  // namespace reference
