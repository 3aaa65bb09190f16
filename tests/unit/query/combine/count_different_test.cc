// Compares the voxels of small files, with lists in scratch files.
#include "query/verify/count_different.h"

#include <cstring>
#include <tuple>

#include "tests/support/error_of.h"
#include "tests/support/faulty_files.h"
#include "tests/unit/core/format/color/colored_files.h"
#include "tests/unit/query/combine/combine_fixture.h"

namespace voxdag::query {
namespace {

class CountDifferent : public Combine {
 protected:
  // With lists of at most `list_bytes`.
  CountDifferentReport count(uint64_t list_bytes, FileSystem& files = system_files()) {
    const auto a = open_global_file(path("a")), b = open_global_file(path("b"));
    CountDifferentSpec spec;
    spec.memory_bytes = uint64_t{64} << 20;
    spec.work_prefix = path("a.work-");
    spec.list_bytes = list_bytes;
    return count_different(*a, *b, spec, files, warnings_, never_);
  }
};

uint64_t count_of(const oracle::Voxels& voxels) {
  uint64_t count = 0;
  for (int x = 0; x < voxels.edge(); ++x)
    for (int y = 0; y < voxels.edge(); ++y)
      for (int z = 0; z < voxels.edge(); ++z) count += voxels.at(x, y, z);
  return count;
}

// With and without scratch files, the counts equal a comparison voxel by voxel. The hash bits of
// the two files differ. Temporary files are removed.
TEST_F(CountDifferent, EqualsAComparisonOfVoxels) {
  for (const int edge : {4, 8, 64})
    for (uint64_t seed = 0; seed < 6; ++seed) {
      SCOPED_TRACE("edge " + std::to_string(edge) + ", seed " + std::to_string(seed));
      const oracle::Voxels a = random_voxels(seed, edge), b = random_voxels(seed / 2, edge);
      write_global(path("a"), a, 64);
      write_global(path("b"), b, 9 + 7 * static_cast<uint32_t>(seed));
      const CountDifferentReport small = count(256), large = count(~uint64_t{0});
      EXPECT_EQ(small.voxels.only_a, count_of(combined_voxels(Operation::kMinus, a, b)));
      EXPECT_EQ(small.voxels.only_b, count_of(combined_voxels(Operation::kMinus, b, a)));
      EXPECT_EQ(small.voxels.only_a, large.voxels.only_a);
      EXPECT_EQ(small.voxels.only_b, large.voxels.only_b);
      EXPECT_EQ(large.work_bytes, 0u);
      EXPECT_EQ(small.work_bytes > 0, edge == 64);
      expect_files({"a", "b"});
    }
}

// All voxels of a file differ from a file without voxels. Most of them are in equal cubes, which
// occur at many places.
TEST_F(CountDifferent, CountsEqualCubesAtAllPlaces) {
  oracle::Voxels full(64);
  fill(full, {0, 0, 0}, {64, 64, 63});
  write_global(path("a"), full);
  write_global(path("b"), oracle::Voxels(64));
  EXPECT_EQ(count(256).voxels.only_a, 64u * 64 * 63);
  EXPECT_EQ(count(256).voxels.only_b, 0u);
}

TEST_F(CountDifferent, FilesOfDifferentGridsAreRefused) {
  write_global(path("a"), random_voxels(1, 64));
  write_global(path("b"), random_voxels(1, 32));
  for (const uint64_t list_bytes : {uint64_t{256}, ~uint64_t{0}})
    EXPECT_EQ(error_of([&] { count(list_bytes); }).code(), ErrorCode::kInvalidInput);
}

// A damaged byte in any level of either file is detected. Temporary files are removed.
TEST_F(CountDifferent, DamagedLevels) {
  write_global(path("a"), random_voxels(7, 64));
  write_global(path("b"), random_voxels(8, 64));
  for (const char* name : {"a", "b"})
    damage_each_level(name, [&] {
      EXPECT_EQ(error_of([&] { count(256); }).code(), ErrorCode::kCorrupt);
      expect_files({"a", "b"});
    });
}

// Wrong words with correct checksums are detected, or give other counts, in the same way with and
// without scratch files.
TEST_F(CountDifferent, HostileLevels) {
  write_global(path("b"), random_voxels(8, 64));
  write_global(path("a"), random_voxels(7, 64));
  const std::string intact = bytes("a");
  std::vector<size_t> places;
  const auto file = open_global_file(path("a"));
  for (uint32_t l = 0; l < file->brick_level(); ++l)
    for (const size_t at : {size_t{0}, size_t{1}, file->level(l).word_count - 1})
      places.push_back(file->level(l).file_offset + 4 * at);
  int refused = 0;
  for (const size_t at : places)
    for (const uint32_t wrong : {0u, 1u, 0xfffffff0u, ~0u}) {
      SCOPED_TRACE(testing::Message() << at << " " << wrong);
      std::string damaged = intact;
      std::memcpy(damaged.data() + at, &wrong, sizeof wrong);
      put_checksums_right(damaged);
      write_bytes(path("a"), damaged);
      const auto outcome = [&](uint64_t list_bytes) {
        try {
          const DiffReport report = count(list_bytes).voxels;
          return std::tuple(ErrorCode::kIo, report.only_a, report.only_b);
        } catch (const Error& error) {
          return std::tuple(error.code(), uint64_t{0}, uint64_t{0});
        }
      };
      const auto small = outcome(256);
      EXPECT_EQ(small, outcome(~uint64_t{0}));
      refused += std::get<0>(small) == ErrorCode::kCorrupt;
      expect_files({"a", "b"});
    }
  EXPECT_GT(refused, 10);
}

// If the disk is full from the n-th write on, the error is kNoSpace. Temporary files are removed.
TEST_F(CountDifferent, FullDisk) {
  write_global(path("a"), random_voxels(7, 64));
  write_global(path("b"), random_voxels(8, 64));
  uint64_t failed = 0;
  for (uint64_t at = 1;; at += 1 + at / 4) {
    SCOPED_TRACE(at);
    crash::FaultyFiles files({crash::Fault::kNoSpace, at});
    try {
      count(256, files);
      break;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kNoSpace);
    }
    expect_files({"a", "b"});
    ++failed;
  }
  EXPECT_GT(failed, 5u);
}

TEST_F(CountDifferent, Canceled) {
  write_global(path("a"), random_voxels(7, 64));
  write_global(path("b"), random_voxels(8, 64));
  class Canceling : public NoProgress {
   public:
    explicit Canceling(CancelToken& token) : token_(token) {}
    void advance(uint64_t) override {
      if (is_comparing_) token_.cancel();
    }
    void begin_stage(std::string_view stage, uint64_t total, std::string_view) override {
      is_comparing_ = stage == "compare" && total > 0;
    }

   private:
    CancelToken& token_;
    bool is_comparing_ = false;
  } progress(never_);
  const auto a = open_global_file(path("a")), b = open_global_file(path("b"));
  CountDifferentSpec spec;
  spec.memory_bytes = uint64_t{64} << 20;
  spec.work_prefix = path("a.work-");
  spec.list_bytes = 256;
  EXPECT_EQ(
      error_of([&] { count_different(*a, *b, spec, system_files(), progress, never_); }).code(),
      ErrorCode::kCanceled);
  expect_files({"a", "b"});
}

}  // namespace
}  // namespace voxdag::query
