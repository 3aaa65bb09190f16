// Artifacts with bytes from a faulty disk: every bit of a small segment is flipped, the segment is
// truncated to every length, and indexes have a valid checksum but impossible contents.
#include <gtest/gtest.h>

#include <cstring>

#include "core/format/artifact/artifact_index.h"
#include "core/format/artifact/artifact_reader.h"
#include "core/format/artifact/artifact_writer.h"
#include "core/format/artifact/frame_codec.h"
#include "core/format/artifact/row_order.h"
#include "core/format/checksum.h"
#include "tests/unit/core/format/test_artifacts.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag {
namespace {

// A segment in memory.
class MemoryFile : public ReadableFile {
 public:
  explicit MemoryFile(ByteString bytes) : bytes_(std::move(bytes)) {}
  const std::string& path() const override { return path_; }
  uint64_t size() const override { return bytes_.size(); }
  void read_at(uint64_t offset, std::span<std::byte> out) const override {
    if (offset > bytes_.size() || out.size() > bytes_.size() - offset)
      throw Error(ErrorCode::kCorrupt, "the file ends early");
    std::memcpy(out.data(), bytes_.data() + offset, out.size());
  }

 private:
  const std::string path_ = "memory.vdseg";
  const ByteString bytes_;
};

SubDag read_all(const ByteString& bytes, const ArtifactRef& ref) {
  return read_artifact(ArtifactReader(std::make_shared<MemoryFile>(bytes), ref));
}

struct SmallSegment {
  explicit SmallSegment(size_t rows = 20) : dag(random_rows(9, rows, 8, 2, 64)) {
    TemporaryFolder folder;
    MemoryBudget budget(kSegmentWriterBytes);
    SegmentWriter segment(system_files(), folder.path(), 0, budget);
    const ArtifactRoot root{{4, {1, 2, 3}}, 1, 0, 10, 3};
    ref = write_artifact(segment, dag, 8, 64, {&root, 1});
    bytes = read_bytes(segment_path(folder.path(), 0));
  }
  std::span<const std::byte> index() const {
    return std::as_bytes(std::span(bytes)).subspan(ref.index_offset);
  }
  SubDag dag;
  ArtifactRef ref;
  ByteString bytes;
};

TEST(ArtifactDamageTest, EveryBitFlipIsCaught) {
  const SmallSegment small;
  ASSERT_EQ(read_all(small.bytes, small.ref), small.dag);
  for (size_t bit = 0; bit < 8 * small.bytes.size(); ++bit) {
    ByteString bytes = small.bytes;
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ 1 << bit % 8);
    EXPECT_THROW(read_all(bytes, small.ref), Error) << "bit " << bit;
  }
}

TEST(ArtifactDamageTest, EveryTruncationIsCaught) {
  const SmallSegment small;
  for (size_t size = 0; size < small.bytes.size(); ++size)
    EXPECT_THROW(read_all(small.bytes.substr(0, size), small.ref), Error) << size << " bytes";
}

// A reference to an artifact with a wrong field, as a damaged job store could contain, causes an
// error.
TEST(ArtifactDamageTest, WildReferencesAreCaught) {
  const SmallSegment small;
  oracle::Random random(1);
  for (int i = 0; i < 2000; ++i) {
    SCOPED_TRACE(i);
    ArtifactRef ref = small.ref;
    uint64_t* const fields[] = {&ref.offset, &ref.bytes, &ref.index_offset, &ref.checksum};
    uint64_t& field = *fields[random.between(0, 3)];
    const uint64_t before = field;
    field = random.coin() ? static_cast<uint64_t>(random.between(0, 3000))
                          : ~static_cast<uint64_t>(random.between(0, 3000));
    if (field == before) continue;
    EXPECT_THROW(read_all(small.bytes, ref), Error);
  }
}

// The index has a right checksum but changed fields. Reading it never crashes, never takes more
// memory than its bytes allow, and never reads outside the file.
TEST(ArtifactDamageTest, MutatedIndexesNeverCrash) {
  const SmallSegment small;
  int refused = 0;
  for (uint64_t seed = 0; seed < 20000; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    oracle::Random random(seed);
    ByteString bytes = small.bytes;
    for (int64_t i = random.between(1, 3); i > 0; --i) {
      const size_t at = static_cast<size_t>(random.between(
          static_cast<int64_t>(small.ref.index_offset), static_cast<int64_t>(bytes.size()) - 1));
      static const int64_t kValues[] = {0, 1, 2, 0x7f, 0x80, 0xff};
      bytes[at] =
          static_cast<char>(random.coin() ? random.between(0, 255) : kValues[random.between(0, 5)]);
    }
    ArtifactRef ref = small.ref;
    ref.checksum = checksum64(std::as_bytes(std::span(bytes)).subspan(ref.index_offset));
    try {
      read_all(bytes, ref);
    } catch (const Error& error) {
      ++refused;
      EXPECT_TRUE(error.code() == ErrorCode::kCorrupt ||
                  error.code() == ErrorCode::kUnsupportedVersion)
          << error.what();
    }
  }
  EXPECT_GT(refused, 10000);
}

// Frames have a right checksum but changed bytes, as in a hostile file. They are decoded or
// refused, without a crash. Decoded rows satisfy the invariants on which the merge depends.
TEST(ArtifactDamageTest, MutatedFramesNeverCrash) {
  const SubDag dag = random_rows(2, 300, 8, 1, 64);
  FrameEncoder encoder;
  const auto copy = [](std::span<const std::byte> bytes) {
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  const std::vector<std::byte> bricks = copy(encoder.encode_bricks(dag.brick_masks));
  const std::vector<std::byte> nodes = copy(encoder.encode_nodes(dag.levels[0].view()));
  const uint32_t child_count = static_cast<uint32_t>(dag.levels[0].children.size());
  Frame frame;
  int refused = 0;
  for (uint64_t seed = 0; seed < 20000; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    oracle::Random random(seed);
    const bool of_bricks = seed % 2 == 0;
    std::vector<std::byte> bytes = of_bricks ? bricks : nodes;
    for (int64_t i = random.between(1, 4); i > 0; --i) {
      const int64_t reach = random.coin() ? 40 : static_cast<int64_t>(bytes.size());
      bytes[static_cast<size_t>(random.between(0, reach - 1))] =
          static_cast<std::byte>(random.between(0, 255));
    }
    if (random.between(0, 9) == 0) bytes.resize(static_cast<size_t>(random.between(0, 100)));
    if (of_bricks) {
      refused += decode_brick_frame(bytes, 300, 64, frame) != nullptr;
    } else if (decode_node_frame(bytes, 300, child_count, frame) != nullptr) {
      ++refused;
    } else {
      LastRow last;
      const NodeLevelView rows{5, frame.hashes, frame.masks, frame.children};
      if (check_node_order(rows, 300, 64, last) != nullptr) continue;
      for (const uint32_t child : frame.children) ASSERT_LT(child, 300u);
    }
  }
  EXPECT_GT(refused, 1000);
}

}  // namespace
}  // namespace voxdag
