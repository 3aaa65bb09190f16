// Tests that ingest gives the same result on any number of threads, and reports the first error of
// the scene.
#include "scheduler/stages/ingest/ingest.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <stdexcept>

#include "core/base/error.h"
#include "core/base/memory_budget.h"
#include "scheduler/triangles/memory_store.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

// A scene of small triangles along a diagonal. Every tenth triangle is far outside the grid. One of
// a hundred is omitted, as a reader omits invalid triangles. Reading triangle `fails_at` fails.
// Triangle `too_far_at` has the coordinate -1e15, which ingest refuses.
class Diagonal : public TriangleSource {
 public:
  static constexpr uint64_t kTriangles = 200'000;
  uint64_t fails_at = kTriangles, too_far_at = kTriangles;
  std::atomic<uint64_t> read = 0;

  unsigned max_cursors = 256;

  std::unique_ptr<TriangleCursor> open(unsigned cursors) override {
    return std::make_unique<Cursor>(*this, cursors);
  }
  uint64_t declared_triangles() const override { return kTriangles; }

 private:
  class Cursor : public TriangleCursor {
   public:
    Cursor(Diagonal& scene, unsigned cursors) : scene_(scene), cursors_(cursors) {}
    void read(uint64_t first, uint64_t count, const Visitor& visit) override {
      if (cursors_ > scene_.max_cursors && first >= kTriangles / 2)
        throw Error(ErrorCode::kOutOfMemory, "so many cursors need more");
      std::vector<WorldTriangle> batch;
      for (uint64_t i = first; i < first + count; ++i) {
        if (i == scene_.fails_at) throw Error(ErrorCode::kIo, "the test's scene cannot be read");
        const double at = static_cast<double>(i) / kTriangles;
        const double x = i % 10 == 0 ? 5 : at;
        if (i % 100 != 1)
          batch.push_back({{{x, at, at}, {x + 0.001, at, at}, {x, at + 0.001, at}}});
        if (i == scene_.too_far_at) batch.back().v[0][0] = -1e15;
        if (batch.size() == 100 || i + 1 == first + count) {
          visit(batch);
          batch.clear();
        }
      }
      scene_.read += count;
    }

   private:
    Diagonal& scene_;
    const unsigned cursors_;
  };
};

constexpr uint64_t kPiece = 16384;

class IngestTest : public testing::TestWithParam<unsigned> {
 protected:
  IngestTest() {
    state_.grid = Grid::given({0, 0, 0}, 1, 10);
    state_.digest = ContentDigest(state_.grid);
    state_.declared_triangles = scene_.declared_triangles();
  }
  void ingest_on(unsigned threads, const AfterPiece& after_piece) {
    const BuildContext build{system_files(), progress_, cancel_};
    ingest(scene_, state_, triangles_, top_, {build, threads, budget_}, after_piece);
  }
  // Checks that the stored triangles, their order, the top tree and the digest are right for the
  // complete scene.
  void expect_whole_scene() {
    ASSERT_EQ(triangles_.count(kSceneBin), state_.counts.triangles);
    std::vector<FixedTriangle> triangles(state_.counts.triangles);
    ASSERT_EQ(triangles_.open(kSceneBin)->read(triangles), triangles.size());
    EXPECT_EQ(checksum64(std::as_bytes(std::span(triangles))), 9115033066486615668u);
    EXPECT_EQ(checksum64(top_.cells()), 17351647304536857767u);
    EXPECT_EQ(state_.digest.hex(), "8a9f2f93e4294be4b6808fa100fdb051");
  }
  Error error_of_ingest(const AfterPiece& after_piece) {
    return error_of([&] { ingest_on(GetParam(), after_piece); });
  }

  Diagonal scene_;
  IngestState state_;
  TemporaryFolder folder_;
  MemoryBudget budget_{uint64_t{256} << 20};
  MemoryStore triangles_{system_files(), folder_.file("spill"), true, budget_};
  TopTree top_{10, budget_, 4};
  NoProgress progress_;
  CancelToken cancel_;
};

TEST_P(IngestTest, ReadsTheSceneInOrder) {
  std::vector<uint64_t> positions;
  ingest_on(GetParam(), [&] {
    positions.push_back(state_.position);
    EXPECT_EQ(state_.counts.triangles + state_.counts.dropped_outside,
              state_.position - (state_.position + 98) / 100);
  });
  ASSERT_EQ(positions.size(), (Diagonal::kTriangles + kPiece - 1) / kPiece);
  for (size_t i = 0; i < positions.size(); ++i)
    EXPECT_EQ(positions[i], std::min((i + 1) * kPiece, Diagonal::kTriangles));
  EXPECT_EQ(state_.counts.dropped_outside, Diagonal::kTriangles / 10);
  EXPECT_EQ(state_.counts.dropped_invalid, Diagonal::kTriangles / 100);
  expect_whole_scene();
}

// Ingest that resumes after any piece of the scene ends in the same state as uninterrupted ingest.
TEST_P(IngestTest, Continues) {
  std::vector<IngestState> states;
  std::vector<std::vector<std::byte>> cells;
  ingest_on(1, [&] {
    states.push_back(state_);
    cells.emplace_back(top_.cells().begin(), top_.cells().end());
  });
  const std::string digest = state_.digest.hex();
  for (size_t i = 0; i < states.size(); ++i) {
    state_ = states[i];
    std::ranges::copy(cells[i], top_.fill(state_.top_tree_weight).begin());
    ingest_on(GetParam(), [] {});
    EXPECT_EQ(state_.digest.hex(), digest);
    EXPECT_TRUE(std::ranges::equal(top_.cells(), cells.back()));
    EXPECT_EQ(state_.position, Diagonal::kTriangles);
  }
}

// If the scene cannot be read from some triangle on, ingest fails. The state then includes all
// complete pieces before this triangle.
TEST_P(IngestTest, ASceneThatFailsIsAnError) {
  scene_.fails_at = 5 * kPiece + 7;
  EXPECT_EQ(error_of_ingest([] {}).code(), ErrorCode::kIo);
  EXPECT_EQ(state_.position, 5 * kPiece);
}

TEST_P(IngestTest, ATriangleFromTooFarIsNamed) {
  scene_.too_far_at = 5 * kPiece + 7;
  const Error error = error_of_ingest([] {});
  EXPECT_EQ(error.code(), ErrorCode::kLimit);
  // The error counts only valid triangles. 820 invalid triangles are omitted before triangle 81927,
  // which is too far away, so the error names triangle 81107.
  EXPECT_NE(error.message().find("triangle 81107 of the scene"), std::string::npos)
      << error.message();
}

// An error at a checkpoint, such as a full disk, stops the reading of the scene.
TEST_P(IngestTest, AnErrorAtACheckpointStopsReading) {
  EXPECT_THROW(ingest_on(GetParam(),
                         [&] {
                           if (state_.position == 2 * kPiece)
                             throw std::runtime_error("the checkpoint failed");
                         }),
               std::runtime_error);
  EXPECT_EQ(state_.position, 2 * kPiece);
  EXPECT_LE(scene_.read, (2 + GetParam()) * kPiece);
}

// If the memory suffices only for one reader of the scene instead of one per thread, ingest
// continues with one reader.
TEST_P(IngestTest, OneReaderIsEnough) {
  scene_.max_cursors = 1;
  ingest_on(GetParam(), [] {});
  expect_whole_scene();
}

TEST_P(IngestTest, OneReaderMayNeedTooMuch) {
  scene_.max_cursors = 0;
  EXPECT_EQ(error_of_ingest([] {}).code(), ErrorCode::kOutOfMemory);
  EXPECT_LE(state_.position, (Diagonal::kTriangles / 2 / kPiece + 1) * kPiece);
}

TEST_P(IngestTest, IsCanceled) {
  EXPECT_EQ(error_of_ingest([&] { cancel_.cancel(); }).code(), ErrorCode::kCanceled);
  EXPECT_EQ(state_.position, kPiece);
}

// The scan finds the bounds of the valid triangles.
TEST_P(IngestTest, ScanFindsTheBounds) {
  const BuildContext build{system_files(), progress_, cancel_};
  uint64_t pieces = 0;
  scan(scene_, state_, {build, GetParam(), budget_}, [&] { ++pieces; });
  EXPECT_EQ(pieces, (Diagonal::kTriangles + kPiece - 1) / kPiece);
  EXPECT_EQ(state_.bounds.low, (std::array<double, 3>{2.0 / Diagonal::kTriangles, 0, 0}));
  EXPECT_EQ(state_.bounds.high[0], 5.001);
}

INSTANTIATE_TEST_SUITE_P(Threads, IngestTest, testing::Values(1, 2, 5),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace voxdag
