// Tests reorder(): the order by first parent must equal the order of a depth-first walk, and
// reordering back must give the original bytes.
#include "query/tiles/tile.h"
#include "tests/unit/core/format/color/valued_files.h"
#include "tests/unit/query/reorder/reorder_fixture.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kNarrow = global_layout::kNarrowLevelWords;

// Limits for the memory of a list or level. With the first, everything is in memory; with the
// second, the pointers of large levels are sorted on the disk; with the third, nearly everything is
// on the disk.
constexpr uint64_t kListLimits[] = {~uint64_t{0}, 2048, 256};

struct SmallFile {
  int edge;
  uint32_t hash_bits;
  uint64_t narrow_words;
};

class ReorderSmall : public Reorder, public testing::WithParamInterface<SmallFile> {};

TEST_P(ReorderSmall, EqualsDepthFirstWalk) {
  const auto [edge, hash_bits, narrow_words] = GetParam();
  write_global(path("a"), oracle::build_dag(random_voxels(7, edge), static_cast<int>(hash_bits)),
               grid_of(edge), hash_bits, narrow_words);
  const LevelWords expected = DepthFirstOrder(*open_global_file(path("a"))).levels();
  for (const uint64_t list_bytes : kListLimits) {
    SCOPED_TRACE(list_bytes);
    ReorderSpec first = spec(NodeOrder::kByFirstParent, "b"), back = spec(NodeOrder::kByHash, "c");
    first.narrow_words = back.narrow_words = narrow_words;
    first.list_bytes = back.list_bytes = list_bytes;
    const ReorderReport report = reorder_file("a", first);
    const auto written = open_global_file(path("b"));
    EXPECT_EQ(written->node_order(), 2u);
    EXPECT_EQ(report.bytes, written->file_bytes());
    EXPECT_TRUE(words_of(*written) == expected);
    EXPECT_NO_THROW(verify("b", narrow_words));
    EXPECT_NO_THROW(verify("b", narrow_words, true));
    reorder_file("b", back);
    EXPECT_TRUE(bytes("c") == bytes("a"));
    const std::string once = bytes("b");
    std::filesystem::copy(path("b"), path("d"), std::filesystem::copy_options::overwrite_existing);
    reorder_file("d", first);  // "d" already has the new order
    EXPECT_TRUE(bytes("b") == once);
    expect_files({"a", "b", "c", "d"});
  }
}

INSTANTIATE_TEST_SUITE_P(Files, ReorderSmall,
                         testing::Values(SmallFile{4, 64, kNarrow}, SmallFile{8, 64, kNarrow},
                                         SmallFile{16, 4, kNarrow}, SmallFile{64, 64, kNarrow},
                                         SmallFile{128, 64, kNarrow}, SmallFile{128, 16, kNarrow},
                                         SmallFile{64, 64, 8}, SmallFile{64, 4, 100}));

TEST_F(Reorder, EmptyFile) {
  write_global(path("a"), oracle::Voxels(16));
  reorder_file("a", spec(NodeOrder::kByFirstParent, "b"));
  EXPECT_NO_THROW(verify("b"));
  EXPECT_EQ(open_global_file(path("b"))->node_order(), 2u);
  reorder_file("b", spec(NodeOrder::kByHash, "c"));
  EXPECT_TRUE(bytes("c") == bytes("a"));
}

// The sections of all attributes are copied byte for byte.
TEST_F(Reorder, KeepsAttributes) {
  const ColoredScene scene{6, 5, random_codes(21, 6, 3000), smooth_colors(5, 4)};
  write_valued(path("a"), scene, AttributeSet::all());
  reorder_file("a", spec(NodeOrder::kByFirstParent, "b"));
  EXPECT_NO_THROW(verify("b"));
  const auto before = open_global_file(path("a")), after = open_global_file(path("b"));
  EXPECT_EQ(attributes_of(*after).list(), AttributeSet::all().list());
  for (const uint64_t code : scene.cells(5)) {
    uint32_t x, y, z;
    morton_decode(code, x, y, z);
    ASSERT_EQ(before->material(x, y, z, 5), after->material(x, y, z, 5));
    ASSERT_EQ(before->color(x, y, z, 5)->r, after->color(x, y, z, 5)->r);
  }
  reorder_file("b", spec(NodeOrder::kByHash, "c"));
  EXPECT_TRUE(bytes("c") == bytes("a"));
}

// A tile numbers its nodes in its own order. So a tile that contains the complete DAG does not
// depend on the order of the nodes in the file.
TEST_F(Reorder, TilesAreEqual) {
  write_global(path("a"), random_voxels(7, 64));
  reorder_file("a", spec(NodeOrder::kByFirstParent, "b"));
  const auto a = open_global_file(path("a")), b = open_global_file(path("b"));
  EXPECT_EQ(encode_tile(DagView(*a), 4, {}), encode_tile(DagView(*b), 4, {}));
}

// The levels of a file in the order by first parent. Tests change them and write them as the file
// "c".
class OrderDefects : public Reorder {
 protected:
  OrderDefects() {
    write_global(path("a"), noise_voxels(7, 64, 3000));
    reorder_file("a", spec(NodeOrder::kByFirstParent, "b"));
    const auto file = open_global_file(path("b"));
    levels_ = words_of(*file);
    for (uint32_t l = 0; l <= file->brick_level(); ++l) nodes_.push_back(file->level(l).node_count);
    counts_ = {file->voxels(), file->svo_nodes()};
  }
  std::vector<uint32_t>& bricks() { return levels_.back(); }
  std::vector<uint32_t>& parents() { return levels_[levels_.size() - 2]; }
  // Writes the levels as "c", and verifies this file. Returns the message of the error; "" if the
  // file is valid.
  std::string verified(bool is_quick = false) {
    GlobalFileWriter writer(system_files(), path("c"), grid_of(64), 64);
    writer.set_node_order(NodeOrder::kByFirstParent);
    for (uint32_t l = static_cast<uint32_t>(levels_.size()); l-- > 0;) {
      writer.begin_level(l);
      writer.checksum_words(levels_[l]);
      writer.write_words(0, levels_[l]);
      writer.end_level({nodes_[l], levels_[l].size()});
    }
    writer.finish(counts_);
    try {
      verify("c", kNarrow, is_quick);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
      return error.message();
    }
    return "";
  }
  // Calls visit(pointer) for each pointer to a brick.
  template <class Visit>
  void for_each_pointer(const Visit& visit) {
    for (size_t at = 0; at < parents().size();) {
      const int children = std::popcount(parents()[at++]);
      for (int c = 0; c < children; ++c) visit(parents()[at++]);
    }
  }

  LevelWords levels_;
  std::vector<uint64_t> nodes_;
  VoxelCounts counts_;
};

TEST_F(OrderDefects, IntactFileIsValid) { EXPECT_EQ(verified(), ""); }

TEST_F(OrderDefects, SwappedBricksAreNamed) {
  std::swap(bricks()[0], bricks()[2]);
  std::swap(bricks()[1], bricks()[3]);
  for_each_pointer([](uint32_t& pointer) {
    if (pointer <= 2) pointer = 2 - pointer;
  });
  EXPECT_NE(verified().find("level 3, word 1: the pointer leads to word 2, but no pointer before "
                            "it leads to the node at word 0: expected the order by first parent"),
            std::string::npos)
      << verified();
}

TEST_F(OrderDefects, UnreachableBrickIsNamed) {
  bricks().insert(bricks().end(), {12345, 678});
  ++nodes_.back();
  EXPECT_NE(
      verified().find("level 4: node " + std::to_string(nodes_.back() - 1) + " has no parent"),
      std::string::npos)
      << verified();
}

// Makes a second copy of a brick, and changes the last pointer so that it refers to the copy. So
// the level has two equal bricks.
TEST_F(OrderDefects, DuplicateIsNamedUnlessQuick) {
  uint32_t* last = nullptr;
  uint32_t highest = 0;
  for_each_pointer([&](uint32_t& pointer) {
    last = &pointer;
    highest = std::max(highest, pointer);
  });
  ASSERT_LT(*last, highest);
  const uint32_t old = *last, low = bricks()[old], high = bricks()[old + 1];
  *last = static_cast<uint32_t>(bricks().size());
  bricks().insert(bricks().end(), {low, high});
  ++nodes_.back();
  EXPECT_EQ(verified(true), "");
  EXPECT_NE(verified().find("the node is equal to the node at word " + std::to_string(old)),
            std::string::npos)
      << verified();
}

// One word of a level is wrong, and the checksums are right. reorder() does not crash, for both
// orders of the output and for any memory.
TEST_F(OrderDefects, HostileLevels) {
  const LevelWords intact = levels_;
  for (size_t l = 0; l < intact.size(); ++l)
    for (const uint32_t wrong : {0u, 1u, 0x100u, static_cast<uint32_t>(intact[l].size() - 1), ~0u})
      for (const size_t at : {size_t{1}, intact[l].size() / 2}) {
        levels_ = intact;
        levels_[l][at] = wrong;
        const bool is_valid = verified().empty();
        for (const uint64_t list_bytes : kListLimits)
          for (const NodeOrder order : {NodeOrder::kByFirstParent, NodeOrder::kByHash}) {
            ReorderSpec limited = spec(order, "d");
            limited.list_bytes = list_bytes;
            SCOPED_TRACE(testing::Message() << l << " " << at << " " << wrong);
            try {
              reorder_file("c", limited);
            } catch (const Error& error) {
              EXPECT_EQ(error.code(), ErrorCode::kCorrupt) << error.message();
              EXPECT_FALSE(is_valid) << error.message();
            }
          }
      }
}

}  // namespace
}  // namespace voxdag::query
