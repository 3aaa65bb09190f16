// Writes PlayCanvas voxels, version 1.1: NAME.voxel.json describes NAME.voxel.bin, which has the
// words of the nodes, then two words for each leaf of 4^3 voxels. A node is one word:
//     interior node   child mask << 24 | index of the first of its children's words
//     mixed leaf      number of the leaf, from 0
//     all solid       0xff000000
// Bit 16z + 4y + x of a leaf is the voxel (x, y, z). Bit 4z + 2y + x of a child mask is the child
// at (x, y, z). An interior node never has the word 0xff000000, because word 0 is the root, not a
// child. A node stores only the index of its children's words, so equal nodes share their children.
#include <array>
#include <cstdio>

#include "core/base/text.h"
#include "core/dag/brick.h"
#include "query/export/export_file.h"
#include "query/export/selected_dag.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kMaxVoxelWords = uint64_t{1} << 24;  // limit of a 24-bit index
constexpr uint32_t kSolid = 0xff000000;
constexpr uint64_t kFullBrick = ~uint64_t{0};

// Converts the index 4x + 2y + z of a child to 4z + 2y + x, or back.
constexpr int reversed_child(int child) { return (child & 1) << 2 | (child & 2) | child >> 2; }

uint64_t leaf_bits(uint64_t brick) {
  uint64_t bits = 0;
  for (; brick != 0; brick &= brick - 1) {
    const int bit = std::countr_zero(brick);
    bits |= uint64_t{1} << (16 * brick_coordinate(bit, 2) + 4 * brick_coordinate(bit, 1) +
                            brick_coordinate(bit, 0));
  }
  return bits;
}

class VoxelWriter {
 public:
  VoxelWriter(const ExportJob& job, const SelectedDag& dag, ExportFile& bin)
      : job_(job), dag_(dag), bin_(bin) {}

  void write() {
    ExportStage stage(job_, "export", dag_.node_count(), "nodes");
    NodeNumbers<uint32_t> below(job_, dag_, dag_.brick_level());
    dag_.for_each_brick([&](uint64_t offset, uint64_t mask) {
      below[offset] = mask == kFullBrick ? kSolid : leaves_++;
    });
    bin_.put(uint32_t{0});  // space for the root's word, which is known only at the end
    for (uint32_t level = dag_.brick_level(); level-- > 0;) {
      NodeNumbers<uint32_t> words(job_, dag_, level);
      dag_.for_each_node(level,
                         [&](uint64_t offset, uint32_t mask, std::span<const uint32_t> children) {
                           words[offset] = add_node(mask, children, below);
                           stage.advance(1);
                         });
      below = std::move(words);
    }
    dag_.for_each_brick([&](uint64_t, uint64_t mask) {
      if (mask != kFullBrick) bin_.put(leaf_bits(mask));
      stage.advance(1);
    });
    bin_.seek(0);
    bin_.put(below[0]);
  }

  void write_json(ExportFile& json) const {
    const auto corner = [&](double offset) {
      std::string text;
      for (size_t axis = 0; axis < 3; ++axis)
        text += (axis ? ", " : "") + number_text(job_.origin(axis) + offset);
      return "[" + text + "]";
    };
    const std::string bounds =
        "{ \"min\": " + corner(0) + ", \"max\": " + corner(job_.file.edge()) + " }";
    json.write("{\n  \"version\": \"1.1\",\n  \"asset\": { \"generator\": \"voxdag\" },\n");
    json.write("  \"gridBounds\": " + bounds + ",\n  \"sceneBounds\": " + bounds + ",\n");
    json.write("  \"voxelResolution\": " + number_text(job_.cell_edge()) +
               ",\n  \"leafSize\": 4,\n");
    const auto number = [&](const char* name, uint64_t value, const char* end = ",\n") {
      json.write("  \"" + std::string(name) + "\": " + std::to_string(value) + end);
    };
    number("treeDepth", dag_.brick_level());
    number("numInteriorNodes", interior_);
    number("numMixedLeaves", leaves_);
    number("nodeCount", words_);
    number("leafDataCount", 2 * uint64_t{leaves_}, "\n}\n");
  }

 private:
  // Returns the word of a node, and writes the words of its children, unless all eight are solid.
  uint32_t add_node(uint32_t mask, std::span<const uint32_t> children,
                    NodeNumbers<uint32_t>& below) {
    std::array<uint32_t, 8> of_child{};
    uint32_t reversed = 0;
    bool solid = children.size() == 8;
    size_t next = 0;
    for (int i = 0; i < 8; ++i) {
      if (!(mask >> i & 1)) continue;
      const uint32_t word = below[children[next++]];
      of_child[static_cast<size_t>(reversed_child(i))] = word;
      reversed |= 1u << reversed_child(i);
      solid = solid && word == kSolid;
    }
    if (solid) return kSolid;
    ++interior_;
    const uint32_t base = words_;
    for (size_t i = 0; i < 8; ++i)
      if (reversed >> i & 1) bin_.put(of_child[i]);
    words_ += static_cast<uint32_t>(children.size());
    return reversed << 24 | base;
  }

  const ExportJob& job_;
  const SelectedDag& dag_;
  ExportFile& bin_;
  uint32_t words_ = 1, leaves_ = 0, interior_ = 0;
};

uint64_t voxel_words(const SelectedDag::Size& size) {
  return 1 + size.words - 2 * size.bricks - size.nodes;
}

}  // namespace

ExportReport write_voxel(const ExportJob& job) {
  const SelectedDag dag(job);
  const SelectedDag::Size size = dag.size_at(dag.grid_levels());
  const auto fits = [&](const SelectedDag::Size& s) {
    return voxel_words(s) <= kMaxVoxelWords && s.bricks <= kMaxVoxelWords;
  };
  if (!fits(size))
    refuse_size(job,
                count_text(voxel_words(size)) + " node words and " + count_text(size.bricks) +
                    " leaves are needed, but the indices of PlayCanvas voxels reach " +
                    count_text(kMaxVoxelWords),
                [&](uint32_t level) { return fits(dag.size_at(level)); });
  require_space(job, 4 * voxel_words(size) + 8 * size.bricks + 4096);
  ExportReport report;
  report.voxels = dag.voxels();
  ExportFile json(job.files, job.output);
  ExportFile bin(job.files, job.second_output);
  VoxelWriter writer(job, dag, bin);
  writer.write();
  writer.write_json(json);
  ExportFile* const written[] = {&bin, &json};
  report.bytes = publish(job, written);
  return report;
}

}  // namespace voxdag::query
