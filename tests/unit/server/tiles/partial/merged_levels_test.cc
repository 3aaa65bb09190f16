// While a job computes colors, its partial view is the complete DAG.
#include "server/tiles/partial/merged_levels.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/format/global/voxdag_reader.h"
#include "scheduler/run_build.h"
#include "scheduler/state/work_folder.h"
#include "server/jobs/process/subvolume_map.h"
#include "server/tiles/partial/partial_views.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/spheres_build.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kResolutionOfJob = 1024;
constexpr uint32_t kLevels = 10;

// Cancels the build after ten subvolumes, or calls `at_color` when the color stage begins.
class Observer : public NoProgress {
 public:
  explicit Observer(std::function<void()> at_color) : at_color_(std::move(at_color)) {}
  void set_grid(const std::array<double, 3>& origin, double edge) override {
    map.set_grid(origin, edge);
  }
  void set_subvolumes(uint64_t resolution, std::span<const SubvolumeStatus> all) override {
    map.set(resolution, all);
  }
  void subvolume_built(const SubvolumeStatus&) override {
    if (!at_color_ && ++built_ == 10) cancel.cancel();
  }
  void begin_stage(std::string_view stage, uint64_t, std::string_view) override {
    if (at_color_ && stage == "color") at_color_();
  }

  SubvolumeMap map;
  CancelToken cancel;

 private:
  const std::function<void()> at_color_;
  int built_ = 0;
};

class MergedLevelsTest : public testing::Test {
 protected:
  void build(const std::function<void()>& at_color) {
    BuildSpec spec = spheres_build(scene_, job_.result());
    spec.geometry.attributes.add(Attribute::kColor);
    spec.run.work_folder = job_.work();
    Observer observer(at_color);
    try {
      run_build(spec, {system_files(), observer, observer.cancel});
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCanceled) << error.what();
    }
    std::ofstream(job_.subvolumes(), std::ios::binary) << observer.map.json();
  }
  void interrupted_build() {
    write_spheres(scene_, 500);
    build({});
  }
  static std::shared_ptr<MergedLevels> open(const JobFolder& job) {
    return MergedLevels::open(system_files(), job, kLevels);
  }
  static void overwrite(const std::string& path, int64_t at) {
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
    file.seekg(at);
    const int byte = file.get();
    file.seekp(at);
    file.put(static_cast<char>(byte ^ 1));
  }

  const TemporaryFolder folder_;
  const JobFolder job_{folder_.path()};
  const std::string scene_ = folder_.file("scene.glb");
};

TEST_F(MergedLevelsTest, AreTheResultWithoutColors) {
  interrupted_build();
  EXPECT_EQ(open(job_), nullptr) << "not merged yet";
  std::shared_ptr<const TileSource> tiles;
  PartialViews views(system_files(), 1);
  build([&] { tiles = views.tiles("job", job_, kResolutionOfJob); });
  ASSERT_NE(tiles, nullptr);
  const auto manifest = nlohmann::json::parse(tiles->manifest({}));
  EXPECT_EQ(manifest["merged"], true) << manifest;
  EXPECT_EQ(manifest["built"], manifest["total"]);
  EXPECT_EQ(manifest["root"]["offset"], 0u);
  EXPECT_EQ(manifest["digest"], tiles->digest());
  EXPECT_EQ(manifest["camera"]["target"].size(), 3u);
  EXPECT_FALSE(tiles->colored_file()->has_colors());

  // The process of the job has written the colors and renamed the file. The levels are still
  // mapped, and no block fails its checksum.
  const voxdag_reader::File result(job_.result());
  EXPECT_TRUE(result.has_colors());
  ASSERT_FALSE(std::filesystem::exists(WorkFolder::frame_path(job_.work())));
  EXPECT_FALSE(tiles->was_overwritten());
  EXPECT_NO_THROW(tiles->expect_readable());
  const query::DagView expected(result);
  for (uint32_t level = 0; level <= kLevels - kBrickLevels; ++level) {
    const auto words = tiles->dag().level(level).words;
    EXPECT_TRUE(std::ranges::equal(words, expected.level(level).words)) << level;
    EXPECT_NO_THROW(tiles->blocks()->expect_intact(words.data(), words.size_bytes())) << level;
  }
  std::filesystem::remove(job_.result());
  EXPECT_FALSE(tiles->was_overwritten()) << "a removed file keeps its contents while it is mapped";
}

TEST_F(MergedLevelsTest, NeedTheFrameOfTheirFile) {
  interrupted_build();
  const JobFolder copy{folder_.file("copy")};
  const std::string frame = WorkFolder::frame_path(copy.work());
  const std::string partial = copy.result() + ".partial";
  std::filesystem::create_directories(copy.work());
  const auto copy_files = [&] {
    const auto replace = std::filesystem::copy_options::overwrite_existing;
    std::filesystem::copy_file(WorkFolder::frame_path(job_.work()), frame, replace);
    std::filesystem::copy_file(job_.result() + ".partial", partial, replace);
  };
  bool was_called = false;
  build([&] {
    was_called = true;
    copy_files();
    ASSERT_NE(open(copy), nullptr);
    EXPECT_EQ(MergedLevels::open(system_files(), copy, kLevels + 1), nullptr);
    const uint64_t bytes = std::filesystem::file_size(frame);
    for (const uint64_t size : {uint64_t{0}, uint64_t{4096}, bytes - 1}) {
      copy_files();
      std::filesystem::resize_file(frame, size);
      EXPECT_EQ(open(copy), nullptr) << size << " bytes of the frame";
    }
    for (const int64_t at : {0, 64, 103, 4096}) {
      copy_files();
      overwrite(frame, at);
      EXPECT_EQ(open(copy), nullptr) << "byte " << at << " of the frame";
    }
    copy_files();
    std::filesystem::resize_file(partial, 8192);
    EXPECT_EQ(open(copy), nullptr) << "a short file";
    // A changed byte of a level is found when its block is read.
    copy_files();
    overwrite(partial, 4096);
    const auto damaged = open(copy);
    ASSERT_NE(damaged, nullptr);
    const auto words = damaged->dag().level(kLevels - kBrickLevels).words;
    EXPECT_THROW(damaged->blocks()->expect_intact(words.data(), 8), DamagedBlock);
    EXPECT_FALSE(damaged->was_overwritten());
    std::filesystem::remove(frame);
    EXPECT_TRUE(damaged->was_overwritten()) << "the merge begins again";
  });
  EXPECT_TRUE(was_called);
}

// Without a job store, a build starts from the beginning, perhaps with another scene. The frame of
// an earlier build does not belong to it.
TEST_F(MergedLevelsTest, FramesOfEarlierBuildsAreRemoved) {
  const std::string frame = WorkFolder::frame_path(job_.work());
  std::filesystem::create_directories(job_.work());
  std::ofstream(frame) << "of an earlier build";
  interrupted_build();
  EXPECT_TRUE(std::filesystem::exists(WorkFolder::store_path(job_.work())));
  EXPECT_FALSE(std::filesystem::exists(frame));
}

}  // namespace
}  // namespace voxdag::server
