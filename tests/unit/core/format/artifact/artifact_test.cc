#include <gmock/gmock.h>

#include "core/format/artifact/artifact_index.h"
#include "core/format/artifact/artifact_reader.h"
#include "core/format/artifact/artifact_writer.h"
#include "core/format/checksum.h"
#include "tests/oracle/core_types.h"
#include "tests/unit/core/format/test_artifacts.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag {
namespace {

using testing::HasSubstr;

class ArtifactTest : public testing::Test {
 protected:
  ArtifactReader open(const ArtifactRef& ref) {
    return ArtifactReader(system_files().open_read(segment_path(folder_.path(), ref.segment)), ref);
  }
  TemporaryFolder folder_;
  MemoryBudget budget_{uint64_t{64} << 20};
};

// The sub-DAG of a voxelized scene, its root and all its counts are read back as they were written.
TEST_F(ArtifactTest, SubDagComesBack) {
  for (const uint32_t hash_bits : {4u, 16u, 64u}) {
    SCOPED_TRACE("hash bits " + std::to_string(hash_bits));
    const oracle::Dag expected =
        oracle::build_dag(random_voxels(hash_bits, 64), static_cast<int>(hash_bits));
    const SubDag dag = oracle::as_sub_dag(expected, 10);
    ArtifactRoot root{{4, {3, 15, 0}}, 0, expected.root_hash, expected.voxels, expected.svo_nodes};
    SegmentWriter segment(system_files(), folder_.path(), 7, budget_);
    const ArtifactRef ref = write_artifact(segment, dag, 10, hash_bits, {&root, 1});
    const ArtifactReader reader = open(ref);
    EXPECT_EQ(read_artifact(reader), dag);
    EXPECT_EQ(reader.shape().grid_levels, 10u);
    EXPECT_EQ(reader.shape().hash_bits, hash_bits);
    ASSERT_EQ(reader.roots().size(), 1u);
    EXPECT_EQ(reader.roots()[0].cube, root.cube);
    EXPECT_EQ(reader.roots()[0].hash, root.hash);
    EXPECT_EQ(reader.roots()[0].voxels, root.voxels);
    EXPECT_EQ(reader.roots()[0].svo_nodes, root.svo_nodes);
    EXPECT_EQ(reader.level(8)->rows, dag.brick_masks.size());
    EXPECT_EQ(reader.level(3), nullptr);
    EXPECT_EQ(reader.level(9), nullptr);
  }
}

// Artifacts are read back unchanged if the number of rows is near the size of a frame (a block of
// rows that is compressed), if child indices have one, two or three bytes, and if columns compress
// well or badly.
TEST_F(ArtifactTest, FramesOfAllSizesComeBack) {
  SegmentWriter segment(system_files(), folder_.path(), 0, budget_);
  for (const size_t count : {1u, 2u, 255u, 4095u, 4096u, 4097u, 9000u, 70000u}) {
    for (const uint32_t hash_bits : {4u, 64u}) {
      SCOPED_TRACE(std::to_string(count) + " rows, hash bits " + std::to_string(hash_bits));
      const SubDag dag = random_rows(count, count, 12, 2, hash_bits);
      const ArtifactReader reader = open(write_artifact(segment, dag, 12, hash_bits));
      EXPECT_EQ(read_artifact(reader), dag);
      for (const ArtifactLevel& level : reader.levels())
        EXPECT_EQ(level.frames.size(), (level.rows + kFrameRows - 1) / kFrameRows);
    }
  }
}

// Child indices of four bytes need a level of over 2^24 rows. In this test, it is the level of the
// bricks.
TEST_F(ArtifactTest, ChildIndicesOfFourBytesComeBack) {
  const uint64_t count = (uint64_t{1} << 24) + 10;
  MemoryBudget budget(uint64_t{1} << 30);
  SegmentWriter segment(system_files(), folder_.path(), 0, budget);
  ArtifactWriter writer(segment, {.grid_levels = 10, .hash_bits = 4});
  // The bricks are the first `count` masks whose 4-bit hash is 0.
  writer.begin_level(8);
  std::vector<uint64_t> masks;
  uint64_t written = 0;
  for (uint64_t mask = 1; written < count; ++mask) {
    if (truncate_hash(hash_brick(mask), 4) != 0) continue;
    masks.push_back(mask);
    if (masks.size() < 50000 && written + masks.size() < count) continue;
    writer.append_bricks(masks);
    written += masks.size();
    masks.clear();
  }
  writer.end_level();
  const std::vector<uint64_t> hashes = {0};
  const std::vector<uint8_t> mask = {7};
  const std::vector<uint32_t> children = {static_cast<uint32_t>(count - 1), 255, 0x01000001};
  writer.nodes({7, hashes, mask, children});
  const ArtifactRef ref = writer.finish({});
  segment.flush();
  Frame frame;
  const ArtifactReader reader = open(ref);
  reader.read_frame(7, 0, frame);
  EXPECT_EQ(frame.children, children);
}

// If a level is appended in pieces of any size, the artifact has the same bytes.
TEST_F(ArtifactTest, PiecesMakeTheSameArtifactAsAWhole) {
  const SubDag dag = random_rows(3, 10000, 9, 1, 64);
  SegmentWriter segment(system_files(), folder_.path(), 0, budget_);
  const ArtifactRef whole = write_artifact(segment, dag, 9, 64);
  SegmentWriter other(system_files(), folder_.path(), 1, budget_);
  ArtifactWriter writer(other, {.grid_levels = 9});
  writer.begin_level(7);
  oracle::Random random(5);
  for (size_t at = 0; at < dag.brick_masks.size();) {
    const size_t n = std::min<size_t>(random.between(0, 5000), dag.brick_masks.size() - at);
    writer.append_bricks(std::span(dag.brick_masks).subspan(at, n));
    at += n;
  }
  writer.end_level();
  writer.begin_level(6);
  const SubDag::Nodes& nodes = dag.levels[0];
  for (size_t at = 0, child = 0; at < nodes.masks.size();) {
    const size_t n = std::min<size_t>(random.between(0, 5000), nodes.masks.size() - at);
    size_t children = 0;
    for (size_t i = at; i < at + n; ++i) children += popcount64(nodes.masks[i]);
    writer.append_nodes({6, std::span(nodes.hashes).subspan(at, n),
                         std::span(nodes.masks).subspan(at, n),
                         std::span(nodes.children).subspan(child, children)});
    at += n;
    child += children;
  }
  writer.end_level();
  const ArtifactRef pieces = writer.finish({});
  other.flush();
  EXPECT_EQ(read_artifact(open(pieces)), read_artifact(open(whole)));
  EXPECT_EQ(pieces.checksum, whole.checksum);
}

// Each of many artifacts in a segment is read back, although bytes of abandoned artifacts are
// between them.
TEST_F(ArtifactTest, ManyArtifactsShareASegment) {
  SegmentWriter segment(system_files(), folder_.path(), 3, budget_);
  std::vector<ArtifactRef> refs;
  for (uint64_t i = 0; i < 20; ++i) {
    refs.push_back(write_artifact(segment, random_rows(i, 100 * i + 1, 8, 2, 64), 8, 64));
    ArtifactWriter abandoned(segment, {.grid_levels = 8});
    abandoned.bricks({random_rows(i, 5000, 8, 0, 64).brick_masks});
  }
  for (uint64_t i = 0; i < 20; ++i)
    EXPECT_EQ(read_artifact(open(refs[i])), random_rows(i, 100 * i + 1, 8, 2, 64)) << i;
}

// The writer charges the memory that its header file documents, and releases all of it.
TEST_F(ArtifactTest, WriterChargesItsMemory) {
  {
    SegmentWriter segment(system_files(), folder_.path(), 0, budget_);
    EXPECT_EQ(budget_.used(), kSegmentWriterBytes);
  }
  EXPECT_EQ(budget_.used(), 0u);
  MemoryBudget small(kSegmentWriterBytes - 1);
  EXPECT_EQ(error_of([&] { SegmentWriter(system_files(), folder_.path(), 1, small); }).code(),
            ErrorCode::kOutOfMemory);
}

// Rows that break an invariant are refused before they are written. The error names the level.
TEST_F(ArtifactTest, WriterRefusesBrokenRows) {
  const SubDag good = random_rows(1, 50, 9, 1, 64);
  const auto refusal = [&](const SubDag& dag, uint32_t hash_bits = 64) {
    SegmentWriter segment(system_files(), folder_.path(), 0, budget_);
    return error_of([&] { write_artifact(segment, dag, 9, hash_bits); }).message();
  };
  SubDag bad = good;
  std::swap(bad.brick_masks[3], bad.brick_masks[4]);
  EXPECT_THAT(refusal(bad), HasSubstr("level 7: bricks are not in the order"));
  bad = good;
  bad.brick_masks[9] = bad.brick_masks[8];
  EXPECT_THAT(refusal(bad), HasSubstr("not in the order"));
  bad = good;
  bad.brick_masks[0] = 0;
  EXPECT_THAT(refusal(bad), HasSubstr("level 7: a brick is empty"));
  bad = good;
  std::swap(bad.levels[0].hashes[3], bad.levels[0].hashes[4]);
  EXPECT_THAT(refusal(bad), HasSubstr("level 6: nodes are not in the total order"));
  bad = good;
  bad.levels[0].children[7] = static_cast<uint32_t>(bad.brick_masks.size());
  EXPECT_THAT(refusal(bad), HasSubstr("level 6: a child index is beyond"));
  bad = good;
  bad.levels[0].children.pop_back();
  EXPECT_THAT(refusal(bad), HasSubstr("children are missing"));
  bad = good;
  bad.levels[0].children.push_back(0);
  EXPECT_THAT(refusal(bad), HasSubstr("children are left over"));
  bad = good;
  bad.levels[0].level = 5;
  EXPECT_THAT(refusal(bad), HasSubstr("level 5 does not follow"));
  bad = random_rows(1, 50, 9, 1, 16);
  bad.levels[0].hashes[40] |= 1;
  EXPECT_THAT(refusal(bad, 16), HasSubstr("bits beyond the hash bits"));
}

// Two rows with equal hash and mask are ordered by their children, even if the rows are in two
// frames.
TEST_F(ArtifactTest, TiesAreOrderedByChildrenAcrossFrames) {
  SubDag dag = random_rows(1, 200, 9, 0, 64);
  SubDag::Nodes& nodes = dag.levels.emplace_back();
  nodes.level = 6;
  for (uint32_t i = 0; i < 2 * kFrameRows; ++i) {
    nodes.hashes.push_back(42);
    nodes.masks.push_back(3);
    nodes.children.push_back(i / 150);
    nodes.children.push_back(i % 150);
  }
  SegmentWriter segment(system_files(), folder_.path(), 0, budget_);
  EXPECT_EQ(read_artifact(open(write_artifact(segment, dag, 9, 64))), dag);
  for (const uint32_t row : {5u, kFrameRows}) {
    SubDag tie = dag;
    tie.levels[0].children[2 * row + 1] = tie.levels[0].children[2 * row - 1];
    tie.levels[0].children[2 * row] = tie.levels[0].children[2 * row - 2];
    EXPECT_THAT(error_of([&] { write_artifact(segment, tie, 9, 64); }).message(),
                HasSubstr("not in the total order"));
  }
}

// A segment with another id or version, and a file that is not a segment, are refused with a
// message that gives the reason.
TEST_F(ArtifactTest, WrongSegmentsAreRefused) {
  SegmentWriter segment(system_files(), folder_.path(), 4, budget_);
  const ArtifactRef ref = write_artifact(segment, random_rows(1, 50, 9, 1, 64), 9, 64);
  const std::string path = segment_path(folder_.path(), 4);
  const auto refusal = [&](const ArtifactRef& asked) {
    return error_of([&] { ArtifactReader(system_files().open_read(path), asked); });
  };
  ArtifactRef other = ref;
  other.segment = 5;
  EXPECT_THAT(refusal(other).message(), HasSubstr("segment 4, expected 5"));
  ByteString bytes = read_bytes(path);
  bytes[8] = 2;
  write_bytes(path, bytes);
  EXPECT_EQ(refusal(ref).code(), ErrorCode::kUnsupportedVersion);
  write_bytes(path, "PK");
  EXPECT_THAT(refusal(ref).message(), HasSubstr("expected a segment header of 32 bytes"));
  write_bytes(path, ByteString(5000, 'x'));
  EXPECT_THAT(refusal(ref).message(), HasSubstr("not a voxdag segment"));
}

}  // namespace
}  // namespace voxdag
