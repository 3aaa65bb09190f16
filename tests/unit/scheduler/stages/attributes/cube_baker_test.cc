// Tests that the records of a color grid's cubes do not depend on the memory for baking.
#include "scheduler/stages/attributes/cube_baker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <vector>

#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/attributes/region_record.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

const std::string kRecordsFile = "records";  // the file that errors of RegionRecords name

constexpr StoredAttribute kAllAttributes[] = {
    {}, {Attribute::kAlpha, 1}, {Attribute::kNormal, 2}, {Attribute::kMaterial, 1}};

struct Baked {
  CubeBaker::Records records;
  size_t parts = 0;  // number of times that the baker handed over records before the end
};

class CubeBaking : public testing::Test {
 protected:
  explicit CubeBaking(uint32_t levels = 9) : grid_{levels, levels} {}

  int64_t random(int64_t below) {
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return static_cast<int64_t>(state_ >> 33) % below;
  }
  void paint(FixedSurface& surface) {
    for (SurfaceCorner& c : surface.corners)
      c.color = {static_cast<uint16_t>(random(65536)), 9, 40000, kFullIntensity};
  }
  // Bakes the complete grid.
  Baked bake(uint64_t region_bytes, uint64_t surface_bytes,
             std::span<const StoredAttribute> attributes = kAllAttributes) {
    MemoryBudget budget(uint64_t{1} << 30);
    NoProgress progress;
    const CancelToken cancel;
    const auto textures = TextureSet::prepare(system_files(), SceneMaterials{},
                                              folder_.file("images"), 1, budget, progress, cancel);
    const auto reader = textures->open(1 << 20);
    MemoryBudget share(surface_bytes, &budget);
    RecordStore store(system_files(), folder_.file("surfaces"), share, "surfaces");
    ChunkList bin;
    std::vector<std::byte> record;
    for (const FixedSurface& surface : surfaces_) {
      record.clear();
      append_surface(surface, false, record);
      store.add(bin, record, 1);
    }
    CubeBaker baker(grid_, attributes, textures->materials(), *reader, store, region_bytes,
                    surface_bytes, budget, cancel);
    Baked baked;
    baked.records.resize(attributes.size());
    CubeBaker::Records last(attributes.size());
    const auto append = [&] {
      size_t most = 0;
      for (size_t i = 0; i < last.size(); ++i) {
        most = std::max(most, last[i].size());
        baked.records[i].insert(baked.records[i].end(), last[i].begin(), last[i].end());
        last[i].clear();
      }
      return most;
    };
    baker.bake(Cube{}, bin, last, [&](CubeBaker::Records& records) {
      EXPECT_EQ(&records, &last);
      const size_t most = append();
      EXPECT_GE(most, CubeBaker::kManyRecordBytes);
      // The baker hands over its records when one attribute has kManyRecordBytes. The last region
      // adds at most 600 KiB of normals to them.
      EXPECT_LE(most, CubeBaker::kManyRecordBytes + (610 << 10));
      ++baked.parts;
    });
    append();
    EXPECT_EQ(bin.records, 0u);
    EXPECT_LE(budget.peak(),
              region_bytes + 2 * ColorMemory::kValueBytes + (2 << 20) + 2 * surface_bytes);
    return baked;
  }

  const TemporaryFolder folder_;
  const ColorGrid grid_;
  uint64_t state_ = 1;
  std::vector<FixedSurface> surfaces_;
};

// If the surfaces of a cube do not fit in memory, they are divided among smaller cubes, down to
// single regions. The records are the same.
TEST_F(CubeBaking, DividesSurfaces) {
  for (int i = 0; i < 3000; ++i) {
    FixedSurface surface;
    int64_t corner[3];
    for (int64_t& c : corner) c = random((int64_t{1} << (grid_.levels + kUnitBits)) - 8000);
    for (auto& vertex : surface.position.v)
      for (int a = 0; a < 3; ++a) vertex[a] = (corner[a] + random(8000)) | 1;
    paint(surface);
    surfaces_.push_back(surface);
  }
  const Baked whole = bake(ColorMemory::kRegionBytes, uint64_t{64} << 20);
  size_t regions = 0;
  for (RegionRecords records(kRecordsFile, whole.records[0]); records.next();) ++regions;
  EXPECT_GT(regions, 100u);
  EXPECT_EQ(bake(ColorMemory::kRegionBytes, 60 << 10).records, whole.records);
  // With 1 KiB, even the surfaces of one region do not fit, so each region processes them in
  // several parts.
  EXPECT_EQ(bake(ColorMemory::kRegionBytes, 1 << 10).records, whole.records);
}

// If only colors are wanted, regions of one flat color are baked by other code. Their records are
// the same. Most regions of this scene have one color, and some have two.
TEST_F(CubeBaking, BakesFlatRegionsLikeOthers) {
  for (int i = 0; i < 400; ++i) {
    FixedSurface surface;
    int64_t corner[3];
    for (int64_t& c : corner) c = random((int64_t{1} << (grid_.levels + kUnitBits)) - 20000);
    for (auto& vertex : surface.position.v)
      for (int a = 0; a < 3; ++a) vertex[a] = (corner[a] + random(20000)) | 1;
    for (SurfaceCorner& c : surface.corners)
      c.color = {9, static_cast<uint16_t>(corner[0] < 40000 ? 300 : 20000), 7, kFullIntensity};
    surfaces_.push_back(surface);
  }
  const Baked all = bake(ColorMemory::kRegionBytes, uint64_t{64} << 20);
  // With 1 KiB, most regions process their surfaces in several parts.
  for (const uint64_t surface_bytes : {uint64_t{64} << 20, uint64_t{1} << 10}) {
    const Baked colors =
        bake(ColorMemory::kRegionBytes, surface_bytes, std::span(kAllAttributes).first(1));
    ASSERT_EQ(colors.records.size(), 1u);
    EXPECT_EQ(colors.records[0], all.records[0]);
  }
  EXPECT_GT(all.records[0].size(), 100000u);
}

class SolidCubes : public CubeBaking {
 protected:
  SolidCubes() : CubeBaking(7) {}
};

// All cells of the grid have surfaces, so that a region needs the largest memory. With less memory,
// its eight children are baked one by one, which gives the same records.
TEST_F(SolidCubes, AreBakedByChildren) {
  constexpr int64_t kEnd = int64_t{1} << (7 + kUnitBits);
  for (int64_t z = kUnitsPerVoxel / 2 | 1; z < kEnd; z += kUnitsPerVoxel)
    for (const int64_t corner : {int64_t{1}, kEnd - 1}) {
      FixedSurface surface;
      surface.position = {{{1, kEnd - 1, z}, {kEnd - 1, 1, z}, {corner, corner, z}}};
      paint(surface);
      surfaces_.push_back(surface);
    }
  const Baked whole = bake(ColorMemory::kSolidRegionBytes, 1 << 20);
  uint64_t cells = 0;
  for (RegionRecords records(kRecordsFile, whole.records[0]); const auto region = records.next();)
    cells += region->counts[0];
  EXPECT_EQ(cells, uint64_t{1} << 21);
  // The baker handed over records several times, so that only a few regions are in memory at any
  // time.
  EXPECT_GE(whole.parts, 4u);
  for (const uint64_t surface_bytes : {1 << 20, 2 << 10}) {
    const Baked by_children = bake(ColorMemory::kRegionBytes, surface_bytes);
    EXPECT_EQ(by_children.records, whole.records);
    EXPECT_EQ(by_children.parts, whole.parts);
  }
}

}  // namespace
}  // namespace voxdag
