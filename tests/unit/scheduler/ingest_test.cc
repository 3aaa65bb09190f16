// Ingest on one thread and on two gives the same result, and reports the errors of both.
#include "scheduler/ingest/ingest.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "core/base/error.h"
#include "core/base/memory_budget.h"
#include "scheduler/triangles/memory_store.h"
#include "tests/unit/base/error_of.h"
#include "tests/unit/io/temporary_folder.h"

namespace voxdag {
namespace {

// Small triangles along a diagonal, every tenth far outside the grid; `fails_at` and `too_far_at`
// are numbers of batches.
class Diagonal : public TriangleSource {
 public:
  static constexpr size_t kBatches = 50, kBatch = 100;
  size_t fails_at = kBatches, too_far_at = kBatches;

  void for_each_batch_from(uint64_t first, const Visitor& visit) override {
    for (position_ = first; position_ < kBatches * kBatch;) {
      const size_t number = position_ / kBatch;
      if (number == fails_at) throw Error(ErrorCode::kIo, "the test's scene cannot be read");
      std::vector<WorldTriangle> batch(kBatch);
      for (size_t i = 0; i < kBatch; ++i) {
        const double at = static_cast<double>(position_ + i) / (kBatches * kBatch);
        const double x = i % 10 == 0 ? 5 : at;
        batch[i] = {{{x, at, at}, {x + 0.001, at, at}, {x, at + 0.001, at}}};
      }
      if (number == too_far_at) batch[7].v[0][0] = -1e15;
      position_ += kBatch;
      visit(batch);
    }
  }
  uint64_t position() const override { return position_; }
  uint64_t declared_triangles() const override { return kBatches * kBatch; }
  uint64_t invalid_triangles() const override { return 0; }

 private:
  uint64_t position_ = 0;
};

class IngestTest : public testing::TestWithParam<unsigned> {
 protected:
  IngestTest() {
    state_.grid = Grid::given({0, 0, 0}, 1, 10);
    state_.digest = ContentDigest(state_.grid);
    state_.declared_triangles = scene_.declared_triangles();
  }
  void ingest_on(unsigned threads, const AfterBatch& after_batch) {
    BinWriter writer(triangles_, {kSceneBin}, size_t{1} << 20);
    ingest(scene_, threads, state_, writer, top_, {system_files(), progress_, cancel_},
           after_batch);
  }
  Error error_of_ingest(const AfterBatch& after_batch) {
    return error_of([&] { ingest_on(GetParam(), after_batch); });
  }

  Diagonal scene_;
  IngestState state_;
  TemporaryFolder folder_;
  MemoryBudget budget_{uint64_t{64} << 20};
  MemoryStore triangles_{system_files(), folder_.file("spill"), true, budget_};
  TopTree top_{10, budget_, 4};
  NoProgress progress_;
  CancelToken cancel_;
};

TEST_P(IngestTest, ReadsTheSceneInOrder) {
  std::vector<uint64_t> positions;
  ingest_on(GetParam(), [&] {
    positions.push_back(state_.position);
    EXPECT_EQ(state_.counts.triangles + state_.counts.dropped_outside, state_.position);
  });
  ASSERT_EQ(positions.size(), Diagonal::kBatches);
  for (size_t i = 0; i < positions.size(); ++i) EXPECT_EQ(positions[i], (i + 1) * Diagonal::kBatch);
  EXPECT_EQ(state_.counts.dropped_outside, Diagonal::kBatches * Diagonal::kBatch / 10);
  EXPECT_EQ(triangles_.count(kSceneBin), state_.counts.triangles);
  // The triangles and their order, whatever the threads.
  ContentDigest digest(state_.grid);
  std::vector<FixedTriangle> triangles(state_.counts.triangles);
  ASSERT_EQ(triangles_.open(kSceneBin)->read(triangles), triangles.size());
  digest.add(triangles);
  EXPECT_EQ(state_.digest.hex(), digest.hex());
}

// What was read before the scene failed is ingested, and the state covers it.
TEST_P(IngestTest, ASceneThatFailsIsAnError) {
  scene_.fails_at = 30;
  EXPECT_EQ(error_of_ingest([] {}).code(), ErrorCode::kIo);
  EXPECT_EQ(state_.position, 30 * Diagonal::kBatch);
}

TEST_P(IngestTest, ATriangleFromTooFarIsNamed) {
  scene_.too_far_at = 30;
  const Error error = error_of_ingest([] {});
  EXPECT_EQ(error.code(), ErrorCode::kLimit);
  EXPECT_NE(error.message().find("triangle 3007 of the scene"), std::string::npos)
      << error.message();
}

// An error at a checkpoint, say of a full disk, ends the reading of the scene.
TEST_P(IngestTest, AnErrorOfTheConsumerStopsReading) {
  EXPECT_THROW(ingest_on(GetParam(),
                         [&] {
                           if (state_.position == 10 * Diagonal::kBatch)
                             throw std::runtime_error("the checkpoint failed");
                         }),
               std::runtime_error);
  EXPECT_EQ(state_.position, 10 * Diagonal::kBatch);
  EXPECT_LT(scene_.position(), scene_.declared_triangles());
}

TEST_P(IngestTest, IsCanceled) {
  EXPECT_EQ(error_of_ingest([&] { cancel_.cancel(); }).code(), ErrorCode::kCanceled);
  EXPECT_EQ(state_.position, Diagonal::kBatch);
}

INSTANTIATE_TEST_SUITE_P(Threads, IngestTest, testing::Values(1, 2),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace voxdag
