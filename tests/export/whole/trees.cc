// Decodes formats that store a tree from the root down: OctoMap's .bt, and DAGs of 32-bit words.
#include <bit>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/export/whole/formats.h"

namespace voxdag::test {
namespace {

using Corner = std::array<int64_t, 3>;

// Returns a child's corner in units of the child's edge. `axes` has the bits of the child's number
// that select its half along x, y and z.
Corner child_of(const Corner& corner, uint32_t child, const std::array<uint32_t, 3>& axes) {
  return {2 * corner[0] + (child & axes[0] ? 1 : 0), 2 * corner[1] + (child & axes[1] ? 1 : 0),
          2 * corner[2] + (child & axes[2] ? 1 : 0)};
}
constexpr std::array<uint32_t, 3> kXFirst = {4, 2, 1}, kZFirst = {1, 2, 4};

uint32_t set_below(uint32_t mask, uint32_t bit) {
  return static_cast<uint32_t>(std::popcount(mask & ((1u << bit) - 1)));
}

// Returns the key (integer coordinates in OctoMap's octree) of the grid's low corner. The key 32768
// is the origin of the octree, which is at most half a voxel from the origin of the scene.
Corner low_corner(const Grid& grid) {
  Corner low;
  for (size_t axis = 0; axis < 3; ++axis)
    low[axis] = 32768 + static_cast<int64_t>(std::floor(grid.origin[axis] / grid.voxel + 0.5));
  return low;
}

// Reads the 16 levels of OctoMap's octree in depth-first order. An inner node has two bytes, with
// two bits per child: 0 is unknown, 1 is free, 2 is occupied, and 3 is an inner node.
struct BtReader {
  const MappedFile& file;
  uint64_t at;
  Corner zero;  // low_corner() of the grid
  Digest& digest;
  uint64_t nodes = 1, known = 0;

  void node(const Corner& corner, int depth) {
    const uint16_t bits = file.get<uint16_t>(at);
    at += 2;
    const uint64_t volume = uint64_t{1} << 3 * (15 - depth);
    for (uint32_t child = 0; child < 8; ++child) {
      const uint32_t state = bits >> 2 * child & 3;
      if (state == 0) continue;
      ++nodes;
      if (state != 3) known += volume;
      if (state != 2) continue;
      add_cube(child_of(corner, child, kZFirst), int64_t{1} << (15 - depth));
    }
    for (uint32_t child = 0; child < 8; ++child) {
      if ((bits >> 2 * child & 3) != 3) continue;
      expect(depth < 15, "16 levels");
      node(child_of(corner, child, kZFirst), depth + 1);
    }
  }
  // Adds all voxels of an occupied cube. `corner` is the cube's low corner, as a multiple of
  // `edge`.
  void add_cube(const Corner& corner, int64_t edge) {
    for (int64_t i = 0; i < edge; ++i)
      for (int64_t j = 0; j < edge; ++j)
        for (int64_t k = 0; k < edge; ++k)
          digest.add(edge * corner[0] + i - zero[0], edge * corner[1] + j - zero[1],
                     edge * corner[2] + k - zero[2]);
  }
};

// Adds the voxels of a brick. Voxel (x, y, z) has the bit 32x1 + 16y1 + 8z1 + 4x0 + 2y0 + z0, where
// x1 is the high bit of x and x0 its low bit; likewise for y and z.
void add_brick(uint64_t mask, const Corner& corner, Digest& digest) {
  for (; mask != 0; mask &= mask - 1) {
    const int bit = std::countr_zero(mask);
    const auto inner = [&](int axis) {
      return (bit >> (2 - axis) & 1) + 2 * (bit >> (5 - axis) & 1);
    };
    digest.add(4 * corner[0] + inner(0), 4 * corner[1] + inner(1), 4 * corner[2] + inner(2));
  }
}

// An array of `count` 32-bit words in a file. It begins at the byte offset `words`.
struct WordFile {
  const MappedFile& file;
  uint64_t words, count;

  uint32_t operator[](uint64_t index) const {
    expect(index < count, "a word of the file");
    return file.get<uint32_t>(words + 4 * index);
  }
};

void hashdag_node(const WordFile& words, uint64_t node, int depth, const Corner& corner,
                  Digest& digest) {
  if (depth == 0) return add_brick(words[node] | uint64_t{words[node + 1]} << 32, corner, digest);
  const uint32_t mask = words[node] & 255;
  for (uint32_t child = 0; child < 8; ++child)
    if (mask >> child & 1)
      hashdag_node(words, words[node + 1 + set_below(mask, child)], depth - 1,
                   child_of(corner, child, kXFirst), digest);
}

void svdag_node(const WordFile& words, uint64_t node, int depth, const Corner& corner,
                Digest& digest) {
  const uint32_t mask = words[node] & 255;
  for (uint32_t child = 0; child < 8; ++child) {
    if (!(mask >> child & 1)) continue;
    const Corner at = child_of(corner, child, kXFirst);
    if (depth == 1)
      digest.add(at[0], at[1], at[2]);
    else
      svdag_node(words, words[node + static_cast<uint32_t>(std::popcount(mask >> child))],
                 depth - 1, at, digest);
  }
}

struct VoxelFile {
  WordFile nodes, leaves;
  Digest& digest;

  void node(uint64_t index, int depth, const Corner& corner) const {
    const uint32_t word = nodes[index], mask = word >> 24, base = word & 0xffffff;
    if (word == 0xff000000) return solid(int64_t{4} << depth, corner);
    if (mask == 0) {
      expect(depth == 0, "leaves on the last level");
      const uint64_t brick = leaves[2 * base] | uint64_t{leaves[2 * base + 1]} << 32;
      for (int bit = 0; bit < 64; ++bit)
        if (brick >> bit & 1)
          digest.add(4 * corner[0] + (bit & 3), 4 * corner[1] + (bit >> 2 & 3),
                     4 * corner[2] + (bit >> 4));
      return;
    }
    for (uint32_t child = 0; child < 8; ++child)
      if (mask >> child & 1)
        node(base + set_below(mask, child), depth - 1, child_of(corner, child, kZFirst));
  }
  void solid(int64_t edge, const Corner& corner) const {
    for (int64_t i = 0; i < edge; ++i)
      for (int64_t j = 0; j < edge; ++j)
        for (int64_t k = 0; k < edge; ++k)
          digest.add(edge * corner[0] + i, edge * corner[1] + j, edge * corner[2] + k);
  }
};

}  // namespace

void digest_bt(const std::string& path, const Grid& grid, Digest& digest) {
  const MappedFile file(path);
  uint64_t at = 0, size = 0;
  expect(file.line(at) == "# Octomap OcTree binary file", "the header of OctoMap");
  for (std::string line; (line = file.line(at)) != "data";) {
    if (line.starts_with("size ")) size = std::stoull(line.substr(5));
    if (line.starts_with("res ")) expect(std::stod(line.substr(4)) == grid.voxel, "that voxel");
  }
  BtReader reader{file, at, low_corner(grid), digest};
  reader.node({0, 0, 0}, 0);
  expect(reader.at == file.size() && reader.nodes == size, "as many nodes as the header says");
  std::fprintf(stderr, "known: %llu cells\n", static_cast<unsigned long long>(reader.known));
}

void digest_hashdag(const std::string& path, const Grid& grid, Digest& digest) {
  const MappedFile file(path);
  const WordFile words{file, 60, file.get<uint64_t>(52)};
  expect(file.get<uint32_t>(48) == static_cast<uint32_t>(grid.levels), "the levels of the grid");
  expect(file.size() == 60 + 4 * words.count, "as many words as the header says");
  hashdag_node(words, 0, grid.levels - 2, {0, 0, 0}, digest);
}

void digest_svdag(const std::string& path, const Grid& grid, Digest& digest) {
  const MappedFile file(path);
  const WordFile words{file, 44, file.get<uint32_t>(40)};
  expect(file.get<uint32_t>(28) == static_cast<uint32_t>(grid.levels), "the levels of the grid");
  expect(file.size() == 44 + 4 * words.count, "as many words as the header says");
  svdag_node(words, 0, grid.levels, {0, 0, 0}, digest);
}

void digest_voxel(const std::string& path, const Grid& grid, Digest& digest) {
  std::ifstream text(path);
  const nlohmann::json about = nlohmann::json::parse(text);
  expect(about["version"] == "1.1" && about["leafSize"] == 4, "version 1.1");
  expect(about["treeDepth"] == grid.levels - 2, "the levels of the grid");
  const MappedFile file(path.substr(0, path.size() - 4) + "bin");
  const uint64_t nodes = about["nodeCount"], leaves = about["leafDataCount"];
  expect(file.size() == 4 * (nodes + leaves), "as many words as the header says");
  VoxelFile{{file, 0, nodes}, {file, 4 * nodes, leaves}, digest}.node(0, grid.levels - 2,
                                                                      {0, 0, 0});
}

}  // namespace voxdag::test
