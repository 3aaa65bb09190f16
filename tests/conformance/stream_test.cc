// The order, number and packing of the triangles do not affect the result. Errors of the stream are
// passed on, and the backend remains usable after them.
#include <algorithm>

#include "core/base/error.h"
#include "tests/conformance/harness.h"

namespace voxdag {
namespace {

using Streams = Conformance;
VOXDAG_FOR_ALL_BACKENDS(Streams);

constexpr SubvolumeTask kTask{8, {1, {1, 0, 1}}, 16};  // 128 voxels per edge

oracle::Triangles mixed_scene(uint64_t seed) {
  oracle::Triangles scene;
  const oracle::Region region = oracle::region_of(kTask.cube, kTask.grid_levels);
  for (const oracle::SceneKind kind : oracle::kAllKinds)
    for (const oracle::Triangle& t : oracle::make_scene(kind, seed, region, 3)) scene.push_back(t);
  return scene;
}

void expect_same(const Built& a, const Built& b) {
  EXPECT_TRUE(a.dag == b.dag);
  EXPECT_EQ(a.summary.voxels, b.summary.voxels);
  EXPECT_EQ(a.summary.svo_nodes, b.summary.svo_nodes);
  EXPECT_EQ(a.summary.dag_nodes, b.summary.dag_nodes);
  EXPECT_EQ(a.summary.root_hash, b.summary.root_hash);
}

// The sub-DAG is the same if the triangles are shuffled and duplicated, if their vertices are
// rotated, and if they are read one by one or in one batch.
TEST_P(Streams, OrderAndRepetitionDoNotShow) {
  const auto backend = open();
  oracle::Triangles scene = mixed_scene(1);
  const Built plain = build(*backend, kTask, scene);
  ASSERT_FALSE(plain.summary.empty());
  oracle::Random random(31);
  for (int round = 0; round < 6; ++round) {
    SCOPED_TRACE(round);
    for (size_t i = scene.size(); i > 1; --i)
      std::swap(scene[i - 1],
                scene[static_cast<size_t>(random.between(0, static_cast<int64_t>(i) - 1))]);
    if (round == 2) scene.insert(scene.end(), scene.begin(), scene.end());
    if (round == 3)
      for (oracle::Triangle& t : scene) std::swap(t[0], t[random.coin() ? 1 : 2]);
    oracle::VectorStream stream(oracle::fixed(scene), round % 2 ? 1 : 100000);
    expect_same(build(*backend, kTask, stream), plain);
  }
}

// If a stream starts in the middle, the backend first rewinds it.
TEST_P(Streams, StartsAtTheFirstTriangle) {
  const auto backend = open();
  const oracle::Triangles scene = mixed_scene(2);
  const Built plain = build(*backend, kTask, scene);
  oracle::VectorStream stream(oracle::fixed(scene));
  FixedTriangle some[7];
  stream.read(some);
  expect_same(build(*backend, kTask, stream), plain);
}

class FailingStream : public oracle::VectorStream {
 public:
  FailingStream(const oracle::Triangles& triangles, int good_reads)
      : VectorStream(oracle::fixed(triangles), 3), good_reads_(good_reads) {}
  size_t read(std::span<FixedTriangle> out) override {
    if (good_reads_-- == 0) throw Error(ErrorCode::kIo, "spill file: read failed");
    return VectorStream::read(out);
  }

 private:
  int good_reads_;
};

// The backend throws an error of the stream unchanged, without calling the sink. Its next build
// gives the correct result.
TEST_P(Streams, ErrorsOfTheStreamComeThrough) {
  const auto backend = open();
  const oracle::Triangles scene = mixed_scene(3);
  for (const int good_reads : {0, 1, 4}) {
    SCOPED_TRACE(good_reads);
    FailingStream stream(scene, good_reads);
    MemoryBudget budget(kAmpleBudget);
    CancelToken never;
    SubDag dag;
    SubDagSummary summary;
    try {
      backend->build(kTask, stream, budget, never, dag, summary);
      ADD_FAILURE() << "no error";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kIo);
    }
    EXPECT_EQ(budget.used(), 0u);
    EXPECT_TRUE(dag.brick_masks.empty());
    expect_right(*backend, kTask, scene);
  }
}

// A sink whose disk becomes full after some calls.
class FullSink : public SubDagSink {
 public:
  explicit FullSink(int good_calls) : good_calls_(good_calls) {}
  void bricks(const BrickLevelView&) override { call(); }
  void nodes(const NodeLevelView&) override { call(); }

 private:
  void call() {
    if (good_calls_-- == 0) throw Error(ErrorCode::kNoSpace, "segment: no space");
  }
  int good_calls_;
};

TEST_P(Streams, ErrorsOfTheSinkComeThrough) {
  const auto backend = open();
  const oracle::Triangles scene = mixed_scene(4);
  for (const int good_calls : {0, 1, 5}) {
    SCOPED_TRACE(good_calls);
    oracle::VectorStream stream(oracle::fixed(scene));
    MemoryBudget budget(kAmpleBudget);
    CancelToken never;
    FullSink sink(good_calls);
    SubDagSummary summary;
    try {
      backend->build(kTask, stream, budget, never, sink, summary);
      ADD_FAILURE() << "no error";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kNoSpace);
    }
    EXPECT_EQ(budget.used(), 0u);
    expect_right(*backend, kTask, scene);
  }
}

// A very long stream. It cancels the build after `reads` reads, and counts the reads after that.
class CancelingStream : public TriangleStream {
 public:
  CancelingStream(const oracle::Triangles& triangles, CancelToken& token, int reads)
      : triangles_(oracle::fixed(triangles)), token_(token), reads_(reads) {}
  uint64_t count() const override { return kReads * triangles_.size(); }
  void rewind() override { done_ = 0; }
  size_t read(std::span<FixedTriangle> out) override {
    late_reads += token_.canceled();
    if (reads_-- == 0) token_.cancel();
    if (done_++ == kReads) return 0;
    const size_t n = std::min(out.size(), triangles_.size());
    std::copy_n(triangles_.begin(), n, out.begin());
    return n;
  }
  static constexpr uint64_t kReads = 30000;
  uint64_t late_reads = 0;

 private:
  std::vector<FixedTriangle> triangles_;
  CancelToken& token_;
  int reads_;
  uint64_t done_ = 0;
};

// A build that is canceled before or while it reads the stream soon throws kCanceled, and sends
// nothing to the sink. The backend remains usable.
TEST_P(Streams, CanBeCanceled) {
  const auto backend = open();
  const SubvolumeTask smallest{12, {6, {9, 8, 7}}, 64};
  for (const SubvolumeTask& task : {kTask, smallest}) {
    const oracle::Region region = oracle::region_of(task.cube, task.grid_levels);
    const auto scene = oracle::make_scene(oracle::SceneKind::kSubVoxel, 1, region, 64);
    for (const int reads : {-1, 0, 3}) {
      SCOPED_TRACE(testing::Message() << "level " << task.cube.level << ", reads " << reads);
      CancelToken token;
      if (reads < 0) token.cancel();
      CancelingStream stream(scene, token, reads);
      MemoryBudget budget(kAmpleBudget);
      SubDag dag;
      SubDagSummary summary;
      try {
        backend->build(task, stream, budget, token, dag, summary);
        ADD_FAILURE() << "no error";
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kCanceled);
      }
      EXPECT_LT(stream.late_reads, 2000u);
      EXPECT_EQ(budget.used(), 0u);
      EXPECT_TRUE(dag.brick_masks.empty());
      expect_right(*backend, task, scene);
    }
  }
}

}  // namespace
}  // namespace voxdag
