#include "server/tiles/partial/coarse_cubes.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "core/base/error.h"
#include "core/format/global/voxdag_reader.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/spheres_build.h"

namespace voxdag {
namespace {

// Computes the mask of the occupied cells of a cube from the finished file. A cube has 4^3 cells.
class Cells {
 public:
  Cells(const voxdag_reader::File& file, const Cube& cube)
      : edge_(cube.edge_voxels(file.grid_levels())) {
    for (int a = 0; a < 3; ++a) low_[a] = cube.position[a] * edge_;
    file.walk(*this);
  }
  bool node(uint32_t level, int64_t x, int64_t y, int64_t z, uint64_t) {
    const int64_t edge = int64_t{1024} >> level, p[3] = {x, y, z};
    for (int a = 0; a < 3; ++a)
      if (p[a] + edge <= low_[a] || p[a] >= low_[a] + edge_) return false;
    if (edge != edge_ / 4) return edge > edge_ / 4;
    int cell[3];
    for (int a = 0; a < 3; ++a) cell[a] = static_cast<int>((p[a] - low_[a]) / edge);
    mask |= uint64_t{1} << voxdag_reader::File::brick_bit(cell[0], cell[1], cell[2]);
    return false;
  }
  void brick(int64_t, int64_t, int64_t, uint64_t, uint64_t) {}

  uint64_t mask = 0;

 private:
  const int64_t edge_;
  int64_t low_[3];
};

class CoarseCubesTest : public testing::Test {
 protected:
  void build(CancelToken& cancel, Progress& progress) {
    write_spheres(scene_, 3000);
    BuildSpec spec = spheres_build(scene_, output_);
    spec.run.keep_work = true;
    run_build(spec, {system_files(), progress, cancel});
  }

  TemporaryFolder folder_;
  const std::string scene_ = folder_.file("scene.glb"), output_ = folder_.file("out.vdag");
  const std::string work_ = output_ + ".work";
};

TEST_F(CoarseCubesTest, HaveTheCellsOfTheResult) {
  CancelToken cancel;
  NoProgress progress;
  build(cancel, progress);
  CoarseCubes cubes;
  cubes.refresh(system_files(), work_);
  EXPECT_EQ(cubes.built(), cubes.total());
  ASSERT_GT(cubes.cubes().size(), 20u);
  const voxdag_reader::File file(output_);
  for (const auto& [id, cube] : cubes.cubes())
    ASSERT_EQ(cube.brick, Cells(file, cube.cube).mask) << "subvolume " << id;
  // If the artifacts are removed, cubes that were already read remain, and a new reader finds no
  // cubes.
  for (const auto& entry : std::filesystem::directory_iterator(work_))
    if (entry.path().extension() == ".vdseg") std::filesystem::remove(entry.path());
  const size_t before = cubes.cubes().size();
  cubes.refresh(system_files(), work_);
  EXPECT_EQ(cubes.cubes().size(), before);
  CoarseCubes late;
  late.refresh(system_files(), work_);
  EXPECT_TRUE(late.cubes().empty());
  EXPECT_EQ(late.built(), cubes.built());
}

// Cancels the build after ten subvolumes are built.
class Canceler : public NoProgress {
 public:
  explicit Canceler(CancelToken& cancel) : cancel_(cancel) {}
  void subvolume_built(const SubvolumeStatus&) override {
    if (++built_ == 10) cancel_.cancel();
  }

 private:
  CancelToken& cancel_;
  int built_ = 0;
};

TEST_F(CoarseCubesTest, GrowWithTheBuild) {
  CancelToken cancel;
  Canceler canceler(cancel);
  EXPECT_EQ(error_of([&] { build(cancel, canceler); }).code(), ErrorCode::kCanceled);
  CoarseCubes cubes;
  cubes.refresh(system_files(), work_);
  const size_t early = cubes.cubes().size();
  EXPECT_GE(cubes.built(), 10u);
  EXPECT_LT(cubes.built(), cubes.total());
  EXPECT_GT(early, 0u);
  CancelToken none;
  NoProgress progress;
  build(none, progress);
  cubes.refresh(system_files(), work_);
  EXPECT_EQ(cubes.built(), cubes.total());
  EXPECT_GT(cubes.cubes().size(), early);
}

TEST_F(CoarseCubesTest, AreReadStepByStep) {
  CancelToken cancel;
  NoProgress progress;
  build(cancel, progress);
  CoarseCubes all, some;
  all.refresh(system_files(), work_);
  for (size_t i = 1; i <= 5; ++i) {
    some.refresh(system_files(), work_, -1);
    EXPECT_EQ(some.cubes().size(), i);
    EXPECT_EQ(some.built(), all.built());
  }
  some.refresh(system_files(), work_);
  EXPECT_EQ(some.cubes().size(), all.cubes().size());
}

TEST_F(CoarseCubesTest, OfNoWorkFolderAreNotFound) {
  CoarseCubes cubes;
  EXPECT_EQ(error_of([&] { cubes.refresh(system_files(), work_); }).code(), ErrorCode::kNotFound);
}

}  // namespace
}  // namespace voxdag
