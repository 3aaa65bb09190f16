#include "tests/oracle/check_sub_dag.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/dag/node_hash.h"
#include "core/dag/sub_dag.h"
#include "tests/oracle/core_types.h"
#include "tests/oracle/scenes.h"

namespace voxdag {
namespace {

constexpr uint32_t kGridLevels = 9;
constexpr uint32_t kCubeLevel = 4;  // 32 voxels: bricks on level 7, nodes on 6, 5 and 4

SubDagShape shape_of(uint32_t hash_bits) { return {kCubeLevel, kGridLevels, hash_bits}; }

// Returns a valid sub-DAG. With few hash bits, some of its nodes have equal truncated hashes.
SubDag right_one(int hash_bits) {
  const oracle::Region region{{0, 0, 0}, 32};
  const auto scene = oracle::make_scene(oracle::SceneKind::kSoup, 3, region, 12);
  return oracle::as_sub_dag(oracle::build_dag(oracle::voxelize(scene, region), hash_bits),
                            kGridLevels);
}

// Returns the index of node i's first child in `nodes.children`.
size_t first_child(const SubDag::Nodes& nodes, size_t i) {
  size_t at = 0;
  for (size_t k = 0; k < i; ++k) at += static_cast<size_t>(popcount64(nodes.masks[k]));
  return at;
}

void append_copy(SubDag::Nodes& nodes, size_t i) {
  const size_t at = first_child(nodes, i), end = first_child(nodes, i + 1);
  nodes.hashes.push_back(nodes.hashes[i]);
  nodes.masks.push_back(nodes.masks[i]);
  for (size_t k = at; k < end; ++k) nodes.children.push_back(nodes.children[k]);
}

uint64_t right_hash(const SubDag& dag, size_t level, size_t i, uint32_t bits) {
  std::vector<uint64_t> hashes;
  const SubDag::Nodes& nodes = dag.levels[level];
  for (size_t k = first_child(nodes, i); k < first_child(nodes, i + 1); ++k)
    hashes.push_back(level ? dag.levels[level - 1].hashes[nodes.children[k]]
                           : truncate_hash(hash_brick(dag.brick_masks[nodes.children[k]]), bits));
  return truncate_hash(hash_node(nodes.masks[i], hashes.data()), bits);
}

struct Damage {
  const char* what;
  const char* message;  // a part of the error message
  std::function<void(SubDag&)> apply;
};

const std::vector<Damage> kDamages = {
    {"a level too few", "2 node levels, expected 3", [](SubDag& d) { d.levels.pop_back(); }},
    {"a level too many", "4 node levels, expected 3",
     [](SubDag& d) { d.levels.push_back(d.levels.back()); }},
    {"a wrong level number", "labeled", [](SubDag& d) { d.levels[1].level = 6; }},
    {"a hash too many", "sized", [](SubDag& d) { d.levels[1].hashes.push_back(0); }},
    {"a hash too few", "sized", [](SubDag& d) { d.levels[1].hashes.pop_back(); }},
    {"no bricks", "level 6, node 0: a child index", [](SubDag& d) { d.brick_masks.clear(); }},
    {"an empty brick", "level 7, node 2: the brick is empty",
     [](SubDag& d) { d.brick_masks[2] = 0; }},
    {"bricks out of order", "level 7",
     [](SubDag& d) { std::swap(d.brick_masks[0], d.brick_masks[1]); }},
    {"a brick twice", "level 7, node 1",
     [](SubDag& d) { d.brick_masks.insert(d.brick_masks.begin(), d.brick_masks[0]); }},
    {"a brick that is another one", "level ", [](SubDag& d) { d.brick_masks.back() ^= 1; }},
    {"a node without children", "level 5, node 0: the child mask is empty",
     [](SubDag& d) { d.levels[1].masks[0] = 0; }},
    {"children missing", "children are missing",
     [](SubDag& d) { d.levels[0].children.pop_back(); }},
    {"children left over", "children are left over",
     [](SubDag& d) { d.levels[2].children.push_back(0); }},
    {"a child out of range", "level 6, node 0: a child index is out of range",
     [](SubDag& d) { d.levels[0].children[0] = static_cast<uint32_t>(d.brick_masks.size()); }},
    {"another child", "the hash is not that of its mask and children",
     [](SubDag& d) { d.levels[0].children[0] ^= 1; }},
    {"another mask of as many children", "the hash is not that of its mask and children",
     [](SubDag& d) {
       uint8_t& mask = d.levels[2].masks[0];
       mask = static_cast<uint8_t>(mask << 1 | mask >> 7);
       if (popcount64(mask) == 8) mask = 0x7f;
     }},
    {"another hash", "the hash is not that of its mask and children",
     [](SubDag& d) { d.levels[1].hashes[0] ^= uint64_t{1} << 62; }},
    {"a node twice", "not in the total order",
     [](SubDag& d) {
       SubDag::Nodes& nodes = d.levels[1];
       append_copy(nodes, nodes.masks.size() - 1);
     }},
    {"a node of the front at the back", "not in the total order",
     [](SubDag& d) { append_copy(d.levels[0], 0); }},
    {"two roots", "level 4", [](SubDag& d) { append_copy(d.levels[2], 0); }},
};

void expect_corrupt(const SubDag& dag, uint32_t bits, const std::string& part) {
  try {
    check_sub_dag(dag, shape_of(bits));
    ADD_FAILURE() << "passed the check";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
    EXPECT_NE(error.message().find(part), std::string::npos) << error.message();
  }
}

// Each damage breaks one invariant. The error names this invariant.
TEST(CheckSubDag, FindsEachBrokenInvariant) {
  const SubDag right = right_one(64);
  ASSERT_NO_THROW(check_sub_dag(right, shape_of(64)));
  for (const Damage& damage : kDamages) {
    SCOPED_TRACE(damage.what);
    SubDag dag = right;
    damage.apply(dag);
    expect_corrupt(dag, 64, damage.message);
  }
}

// With 4 hash bits, many bricks have equal hashes. Such bricks must be in the order of their masks.
TEST(CheckSubDag, KnowsTheOrderOfTies) {
  const SubDag right = right_one(4);
  ASSERT_NO_THROW(check_sub_dag(right, shape_of(4)));
  int ties = 0;
  for (size_t i = 1; i < right.brick_masks.size(); ++i) {
    if (truncate_hash(hash_brick(right.brick_masks[i - 1]), 4) !=
        truncate_hash(hash_brick(right.brick_masks[i]), 4))
      continue;
    ++ties;
    SubDag dag = right;
    std::swap(dag.brick_masks[i - 1], dag.brick_masks[i]);
    expect_corrupt(dag, 4, "level 7");
  }
  EXPECT_GT(ties, 10);
}

// Eight nodes have the same mask, and each has a different brick. Some of them have equal truncated
// hashes, so exchanging them makes only the order wrong, not the hashes.
TEST(CheckSubDag, KnowsTheOrderOfTiedNodes) {
  oracle::Random random(2);
  oracle::Voxels voxels(16);
  for (int i = 0; i < 8; ++i)
    for (int v = 0; v < 8; ++v)
      voxels.set(8 * (i / 4) + static_cast<int>(random.between(0, 3)),
                 8 * (i / 2 % 2) + static_cast<int>(random.between(0, 3)),
                 8 * (i % 2) + static_cast<int>(random.between(0, 3)));
  const SubDag right = oracle::as_sub_dag(oracle::build_dag(voxels, 4), 4);
  ASSERT_NO_THROW(check_sub_dag(right, {.cube_level = 0, .grid_levels = 4, .hash_bits = 4}));
  int ties = 0;
  for (size_t i = 1; i < right.levels[0].masks.size(); ++i) {
    SubDag dag = right;
    SubDag::Nodes& nodes = dag.levels[0];
    ASSERT_EQ(nodes.masks[i], 1);
    if (nodes.hashes[i - 1] != nodes.hashes[i]) continue;
    ++ties;
    std::swap(nodes.children[i - 1], nodes.children[i]);
    try {
      check_sub_dag(dag, {.cube_level = 0, .grid_levels = 4, .hash_bits = 4});
      ADD_FAILURE() << "passed the check";
    } catch (const Error& error) {
      EXPECT_NE(error.message().find("not in the total order"), std::string::npos)
          << error.message();
    }
  }
  EXPECT_GT(ties, 0);
}

// A sub-DAG whose hashes are truncated to a different number of bits is refused.
TEST(CheckSubDag, KnowsTheHashBits) {
  expect_corrupt(right_one(64), 16, "level ");
  expect_corrupt(right_one(16), 64, "level ");
}

// A node without a parent is refused on any level, because it is not part of the DAG.
TEST(CheckSubDag, FindsOrphans) {
  const SubDag right = right_one(64);
  SubDag bricks = right;
  // The added brick has a larger hash than all others, so the order remains right.
  uint64_t mask = 1;
  while (hash_brick(mask) <= hash_brick(bricks.brick_masks.back())) ++mask;
  bricks.brick_masks.push_back(mask);
  expect_corrupt(bricks, 64, "no parent refers to it");

  SubDag nodes = right;
  SubDag::Nodes& level = nodes.levels[1];
  const size_t last = level.masks.size();
  for (uint32_t child = 0;
       level.masks.size() == last || level.hashes[last] <= level.hashes[last - 1]; ++child) {
    ASSERT_LT(child, nodes.levels[0].masks.size()) << "no orphan can be made of this scene";
    level.masks.resize(last);
    level.hashes.resize(last);
    level.children.resize(first_child(right.levels[1], last));
    level.masks.push_back(0x10);
    level.children.push_back(child);
    level.hashes.push_back(right_hash(nodes, 1, last, 64));
  }
  expect_corrupt(nodes, 64, "no parent refers to it");
}

// The DAG of a cube as large as a brick has one brick and no levels of nodes. Anything else is
// refused.
TEST(CheckSubDag, BrickCubes) {
  SubDag dag;
  dag.brick_masks = {5};
  EXPECT_NO_THROW(check_sub_dag(dag, {.cube_level = 7, .grid_levels = kGridLevels}));
  EXPECT_NO_THROW(check_sub_dag(dag, {.hash_bits = 4}));
  EXPECT_THROW(check_sub_dag(dag, {.cube_level = 6, .grid_levels = kGridLevels}), Error);
  EXPECT_THROW(check_sub_dag(dag, {.cube_level = 8, .grid_levels = kGridLevels}), Error);
  EXPECT_THROW(check_sub_dag({}, {.cube_level = 7, .grid_levels = kGridLevels}), Error);
  dag.brick_masks.push_back(0);
  EXPECT_THROW(check_sub_dag(dag, {.cube_level = 7, .grid_levels = kGridLevels}), Error);
}

}  // namespace
}  // namespace voxdag
