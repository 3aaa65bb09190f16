#include "core/format/verify/verify.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <functional>

#include "core/format/checksum.h"
#include "core/format/global/diff.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/open_global.h"
#include "tests/unit/core/format/test_files.h"
#include "tests/unit/core/format/verify_both_ways.h"

namespace voxdag {
namespace {

using namespace global_layout;
using testing::HasSubstr;

void verify(const std::string& path, unsigned threads, uint64_t narrow_words = kNarrowLevelWords) {
  verify_in_memory(*open_global_file(path), {threads, narrow_words});
}
void verify(const std::string& path) { verify_both_ways(*open_global_file(path)); }

template <class T>
void put(ByteString& bytes, size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof(value));
}

template <class T>
T get(const ByteString& bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(value));
  return value;
}

uint64_t checksum_of(const ByteString& bytes, size_t begin, size_t size) {
  return checksum64(std::as_bytes(std::span(bytes)).subspan(begin, size));
}

// Corrects all checksums, so that `verify` must find the error in the contents.
void reseal(ByteString& bytes) {
  const size_t table = get<uint64_t>(bytes, kTableOffsetAt);
  for (size_t begin = kPageBytes, i = 0; begin < table; begin += kChecksumBlockBytes, ++i)
    put(bytes, table + 8 * i,
        checksum_of(bytes, begin, std::min<size_t>(kChecksumBlockBytes, table - begin)));
  put(bytes, kTableChecksumAt, checksum_of(bytes, table, bytes.size() - table));
  put(bytes, kHeaderChecksumAt, checksum_of(bytes, 0, kHeaderChecksumAt));
}

class VerifyTest : public testing::Test {
 protected:
  TemporaryFolder folder_;
  const std::string path_ = folder_.file("scene.vdag");
};

// A file that the writer made from a right DAG passes, for any voxels and hash bits.
TEST_F(VerifyTest, RightFilesPass) {
  for (const int edge : {4, 8, 16, 64, 128})
    for (const uint32_t hash_bits : {4u, 16u, 64u}) {
      SCOPED_TRACE("edge " + std::to_string(edge) + ", hash bits " + std::to_string(hash_bits));
      write_global(path_, random_voxels(hash_bits, edge), hash_bits);
      EXPECT_NO_THROW(verify(path_));
    }
  write_global(path_, oracle::Voxels(32));
  EXPECT_NO_THROW(verify(path_));
  // Several windows of nodes whose cubes have more than 32 voxels per edge.
  write_global(path_, noise_voxels(1, 256, 200));
  ASSERT_GT(open_global_file(path_)->level(2).word_count, 3 * 64u);
  ASSERT_EQ(span_words_of(*open_global_file(path_)), 64u);
  EXPECT_NO_THROW(verify(path_));
}

// `verify` detects each single flipped bit of a file of 8^3 voxels.
TEST_F(VerifyTest, EveryBitFlipIsCaught) {
  write_global(path_, random_voxels(5, 8));
  const ByteString bytes = read_bytes(path_);
  const auto file = system_files().open_write(path_);
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    const char flipped = static_cast<char>(bytes[bit / 8] ^ 1 << bit % 8);
    file->write_at(bit / 8, std::as_bytes(std::span(&flipped, 1)));
    EXPECT_THROW(verify(path_, 1), Error) << "bit " << bit;
    file->write_at(bit / 8, std::as_bytes(std::span(&bytes[bit / 8], 1)));
  }
  EXPECT_NO_THROW(verify(path_));
}

TEST_F(VerifyTest, EveryTruncationIsCaught) {
  write_global(path_, random_voxels(5, 8));
  for (size_t size = read_bytes(path_).size(); size-- > 0;) {
    std::filesystem::resize_file(path_, size);
    EXPECT_THROW(verify(path_), Error) << size << " bytes";
  }
}

TEST_F(VerifyTest, TrailingBytesAreCaught) {
  write_global(path_, random_voxels(5, 8));
  for (const size_t more : {1u, 8u, 4096u}) {
    write_bytes(path_, read_bytes(path_) + ByteString(more, '\0'));
    EXPECT_THROW(verify(path_), Error) << more << " bytes";
  }
}

// Each of the three passes over the file (checksums, index and nodes) reports the bytes that it
// reads to PageLimit. PageLimit drops pages during the passes, and the file is still valid.
TEST_F(VerifyTest, PagesAreDroppedAboveTheLimit) {
  write_global(path_, random_voxels(5, 128));
  const auto file = open_global_file(path_);
  uint64_t node_bytes = 0;
  for (uint32_t level = 0; level <= file->brick_level(); ++level)
    node_bytes += sizeof(uint32_t) * file->level(level).word_count;
  MemoryBudget budget(uint64_t{1} << 30);
  NoProgress progress;
  PageLimit pages(*file, 0, kPageBytes);
  EXPECT_NO_THROW(
      verify_global_file(*file, 3, budget, progress, {}, kNarrowLevelWords, false, &pages));
  EXPECT_GE(pages.touched_bytes(), 3 * node_bytes);
}

// The error names the damaged block in the middle of a large file.
TEST_F(VerifyTest, DamagedBlockIsNamed) {
  write_global(path_, noise_voxels(1, 128, 60000));
  ByteString bytes = read_bytes(path_);
  ASSERT_GT(bytes.size(), kPageBytes + 2 * kChecksumBlockBytes);
  bytes[kPageBytes + kChecksumBlockBytes + 100] ^= 1;
  write_bytes(path_, bytes);
  EXPECT_THAT(error_of([&] { verify(path_); }).message(),
              HasSubstr("bytes 69632 to 135167: the block fails its checksum"));
}

// DAGs that each break one rule, in files with right checksums.
struct BrokenDag {
  const char* rule;
  std::function<void(oracle::Dag&)> break_it;
  const char* message;
};

// Adds a brick to which no node refers, at its right position in the order.
void add_lonely_brick(oracle::Dag& dag) {
  const uint64_t lonely = 0x0123456789abcdef;
  dag.bricks.push_back(lonely);
  std::sort(dag.bricks.begin(), dag.bricks.end(),
            [](uint64_t a, uint64_t b) { return oracle::brick_hash(a) < oracle::brick_hash(b); });
  const auto at = std::find(dag.bricks.begin(), dag.bricks.end(), lonely) - dag.bricks.begin();
  for (oracle::Node& node : dag.levels[0])
    for (uint32_t& child : node.children) child += child >= at;
}

// Adds a second root: a copy of the root without its last child.
void add_second_root(oracle::Dag& dag) {
  std::vector<oracle::Node>& roots = dag.levels.back();
  oracle::Node root = roots[0];
  root.mask &= (1u << (std::bit_width(root.mask) - 1)) - 1;
  root.children.pop_back();
  std::vector<uint64_t> hashes;
  for (const uint32_t child : root.children)
    hashes.push_back(dag.levels[dag.levels.size() - 2][child].hash);
  root.hash = oracle::node_hash(root.mask, hashes);
  roots.push_back(root);
  std::sort(roots.begin(), roots.end());
}

void PrintTo(const BrokenDag& broken, std::ostream* out) { *out << broken.rule; }

class BrokenDagTest : public VerifyTest, public testing::WithParamInterface<BrokenDag> {};

TEST_P(BrokenDagTest, IsCaughtAndNamed) {
  // The bricks need over 10 windows of 64 words, the nodes above them over 5.
  oracle::Dag dag = oracle::build_dag(noise_voxels(7, 32, 3000), 64);
  ASSERT_GT(dag.bricks.size(), 640u / 2);
  ASSERT_EQ(dag.levels[0].size(), 64u);
  GetParam().break_it(dag);
  write_global(path_, dag, grid_of(32));
  const Error error = error_of([&] { verify(path_); });
  EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
  EXPECT_THAT(error.message(), HasSubstr(GetParam().message));
  EXPECT_THAT(error.message(), HasSubstr(path_));
}

INSTANTIATE_TEST_SUITE_P(
    Rules, BrokenDagTest,
    testing::Values(
        BrokenDag{"bricks ordered", [](auto& dag) { std::swap(dag.bricks[2], dag.bricks[3]); },
                  "level 3, word 6: the brick does not follow"},
        BrokenDag{"bricks unique", [](auto& dag) { dag.bricks[3] = dag.bricks[2]; },
                  "level 3, word 6: the brick does not follow"},
        BrokenDag{"no empty brick", [](auto& dag) { dag.bricks[3] = 0; },
                  "level 3, word 6: the brick is empty"},
        BrokenDag{"nodes ordered", [](auto& dag) { std::swap(dag.levels[0][1], dag.levels[0][2]); },
                  "does not follow the one before it in the total order"},
        BrokenDag{"nodes unique", [](auto& dag) { dag.levels[0][2] = dag.levels[0][1]; },
                  "does not follow the one before it in the total order"},
        BrokenDag{"all bricks reachable", add_lonely_brick, " has no parent"},
        BrokenDag{"mask within 8 bits", [](auto& dag) { dag.levels[0][0].mask |= 256; },
                  "level 2, word 0: child mask "},
        BrokenDag{"mask not 0",
                  [](auto& dag) {
                    dag.levels[0][0].mask = 0;
                    dag.levels[0][0].children.clear();
                  },
                  "level 2, word 0: child mask 0, expected 1 to 255"},
        BrokenDag{"one root", add_second_root, "level 0: 2 roots, expected 1"},
        BrokenDag{"voxels counted", [](auto& dag) { ++dag.voxels; }, "voxels, the DAG has "},
        BrokenDag{"octree nodes counted", [](auto& dag) { --dag.svo_nodes; },
                  "octree nodes, the DAG has "}));

// Adds a node without a parent to level 1, at its right position in the order. Returns the node's
// index.
uint64_t add_lonely_node(oracle::Dag& dag) {
  std::vector<oracle::Node>& nodes = dag.levels[dag.levels.size() - 2];
  const std::vector<oracle::Node>& below = dag.levels[dag.levels.size() - 3];
  oracle::Node lonely;
  for (uint32_t child = 0; lonely.children.empty(); ++child) {
    lonely = {oracle::node_hash(1, {below[child].hash}), 1, {child}};
    if (std::find(nodes.begin(), nodes.end(), lonely) != nodes.end()) lonely.children.clear();
  }
  const auto at = std::lower_bound(nodes.begin(), nodes.end(), lonely);
  const auto index = static_cast<uint32_t>(at - nodes.begin());
  nodes.insert(at, lonely);
  for (uint32_t& child : dag.levels.back()[0].children) child += child >= index;
  return index;
}

// If several levels have nodes without a parent, the error names the first such node of the
// coarsest of these levels. Here this is a level for which `verify` uses words of 64 bits
// (subtree_table.h).
TEST_F(VerifyTest, TheCoarsestNodeWithoutAParentIsNamed) {
  oracle::Dag dag = oracle::build_dag(random_voxels(7, 128), 64);
  add_lonely_brick(dag);
  const uint64_t index = add_lonely_node(dag);
  write_global(path_, dag, grid_of(128));
  EXPECT_THAT(error_of([&] { verify(path_); }).message(),
              HasSubstr("level 1: node " + std::to_string(index) + " has no parent"));
}

// The error names a child pointer whose word offset is in the middle of a node of the next level,
// or beyond the end of the next level.
TEST_F(VerifyTest, ChildrenThatBeginNoNodeAreNamed) {
  const oracle::Dag dag = oracle::build_dag(noise_voxels(7, 32, 3000), 64);
  for (const uint32_t offset : {1u, 1000000u, 0xffffffffu}) {
    write_global(path_, dag, grid_of(32));
    ByteString bytes = read_bytes(path_);
    const size_t parents = get<uint64_t>(bytes, kLevelsAt + 2 * kLevelEntryBytes);
    put(bytes, parents + 4, offset);
    reseal(bytes);
    write_bytes(path_, bytes);
    EXPECT_THAT(error_of([&] { verify(path_); }).message(),
                HasSubstr("level 2, word 1: a child at word " + std::to_string(offset) +
                          ", where no node of level 3 begins"));
  }
}

// The error names a byte that must be zero but is not, even if all checksums are right.
TEST_F(VerifyTest, NonZeroReservedBytesAndPaddingAreCaught) {
  write_global(path_, random_voxels(5, 8));
  const ByteString bytes = read_bytes(path_);
  const size_t levels_end = kLevelsAt + 2 * kLevelEntryBytes;
  for (const size_t at :
       {kAttributeCountAt, kLevelsAt + 24, levels_end, kAttributesAt, kReservedAt,
        kHeaderChecksumAt - 1, size_t{2 * kPageBytes - 1}, size_t{3 * kPageBytes - 1}}) {
    ByteString changed = bytes;
    changed[at] = 1;
    reseal(changed);
    write_bytes(path_, changed);
    EXPECT_THAT(error_of([&] { verify(path_); }).message(),
                HasSubstr("byte " + std::to_string(at) + ": "));
  }
}

TEST_F(VerifyTest, OtherNodeOrdersAreNotRead) {
  write_global(path_, random_voxels(5, 8));
  ByteString bytes = read_bytes(path_);
  put(bytes, kNodeOrderAt, uint32_t{3});
  reseal(bytes);
  write_bytes(path_, bytes);
  EXPECT_EQ(error_of([&] { verify(path_); }).code(), ErrorCode::kUnsupportedVersion);
}

// A large file has several defects. The threads verify different parts of the file, but the first
// defect is reported with any number of threads.
TEST_F(VerifyTest, TheFirstDefectIsReported) {
  write_global(path_, noise_voxels(3, 256, 1600000));
  oracle::Random random(3);
  const ByteString bytes = read_bytes(path_);
  const auto words_end = static_cast<int64_t>(get<uint64_t>(bytes, kTableOffsetAt));
  for (int round = 0; round < 8; ++round) {
    ByteString changed = bytes;
    for (int i = 0; i < 4; ++i)
      changed[static_cast<size_t>(random.between(kPageBytes, words_end - 1))] ^= 1;
    reseal(changed);
    write_bytes(path_, changed);
    const std::string message = error_of([&] { verify(path_, 1); }).message();
    for (int i = 0; i < 3; ++i) EXPECT_EQ(error_of([&] { verify(path_, 4); }).message(), message);
    const auto file = open_global_file(path_);
    EXPECT_EQ(error_of([&] { verify_in_windows(*file, {}, 0); }).message(), message);
  }
}

// The hash bits determine the order of nodes, so a header with other hash bits than the file was
// made with is an error.
TEST_F(VerifyTest, WrongHashBitsAreCaught) {
  write_global(path_, random_voxels(3, 64), 64);
  ByteString bytes = read_bytes(path_);
  put(bytes, kHashBitsAt, uint32_t{8});
  reseal(bytes);
  write_bytes(path_, bytes);
  EXPECT_THROW(verify(path_), Error);
}

// Random changes in files with corrected checksums. Readers never crash. If `verify` accepts a
// file, a walk finds as many voxels as its header gives.
class MutationTest : public VerifyTest, public testing::WithParamInterface<uint64_t> {};

TEST_P(MutationTest, NeverCrashesAReader) {
  const std::string original = folder_.file("original.vdag");
  write_global(original, oracle::build_dag(random_voxels(11, 16), 64), grid_of(16), 64, GetParam());
  const ByteString bytes = read_bytes(original);
  const auto whole = open_global_file(original);
  write_bytes(path_, bytes);
  const auto file_to_change = system_files().open_write(path_);
  const size_t words_end = get<uint64_t>(bytes, kTableOffsetAt);
  int refused = 0;
  for (uint64_t seed = 0; seed < 5000; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    oracle::Random random(seed);
    ByteString changed = bytes;
    for (int64_t i = random.between(1, 4); i > 0; --i) {
      // The changed byte is in the header's fields, in a level's first words, or anywhere.
      const size_t at = static_cast<size_t>(
          random.coin()   ? random.between(0, 300)
          : random.coin() ? random.between(1, 3) * 4096 + random.between(0, 60)
                          : random.between(0, static_cast<int64_t>(words_end) - 1));
      changed[at] =
          static_cast<char>(random.coin() ? random.between(0, 16) : random.between(0, 255));
    }
    const uint64_t table = get<uint64_t>(changed, kTableOffsetAt);
    if (table >= kPageBytes && table + 8 == changed.size()) reseal(changed);
    put(changed, kHeaderChecksumAt, checksum_of(changed, 0, kHeaderChecksumAt));
    file_to_change->write_at(0, std::as_bytes(std::span(changed)));
    try {
      const auto file = open_global_file(path_);
      with_reader_errors([&] {
        for (int i = 0; i < 64; ++i)
          file->voxel(random.between(-1, 16), random.between(-1, 16), random.between(-1, 16));
      });
      if (file->grid_levels() == 4) {
        MemoryBudget budget(uint64_t{1} << 30);
        const CancelToken cancel;
        diff_global_files(*file, *whole, 2, budget, cancel);
      }
      if (seed % 16 == 0)
        verify_both_ways(*file, {3, GetParam()});
      else
        verify(path_, 3, GetParam());
      struct {
        bool node(uint32_t, int64_t, int64_t, int64_t, uint64_t) { return true; }
        void brick(int64_t, int64_t, int64_t, uint64_t mask, uint64_t) {
          voxels += static_cast<uint64_t>(popcount64(mask));
        }
        uint64_t voxels = 0;
      } counter;
      file->walk(counter);
      EXPECT_EQ(counter.voxels, file->voxels());
    } catch (const Error& error) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 2500);
}

INSTANTIATE_TEST_SUITE_P(NarrowWords, MutationTest, testing::Values(2, kNarrowLevelWords),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace voxdag
