// The files of HashDAG (Careil, Billeter, Eisemann 2020) and of the viewers derived from it:
//     NAME.basic_dag.dag.bin                   f64 x 6 bounds | u32 levels | u64 words | u32 ...
//     NAME.basic_dag.uncompressed_colors.bin   u32 top levels | u64 n, u64 ... | u64 m, u32 ...
// A node is one word, then the absolute word index of each child. The low byte of the first word is
// the child mask; its other 24 bits are the number of voxels that the node encloses. In the top
// levels, whose counts can be larger, these 24 bits are an index into the n voxel counts of the
// color file. A leaf is two words, like a brick. The m colors are bytes R, G, B and 255 for each
// voxel in Morton order, or a single gray for a file without colors.
#include <algorithm>
#include <array>
#include <bit>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "query/export/export_file.h"
#include "query/export/selected_dag.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kMaxHashDagWords = uint64_t{1} << 32;  // word indices have 32 bits
constexpr uint64_t kMaxHashDagColors = (uint64_t{1} << 32) - 1;
constexpr uint64_t kMaxCount = uint64_t{1} << 24;  // smaller counts fit above the child mask
constexpr uint32_t kGray = 0xffb0b0b0;             // A, B, G, R, from the highest byte down
constexpr uint64_t kHashDagHeaderBytes = 6 * sizeof(double) + sizeof(uint32_t) + sizeof(uint64_t);

// Returns the number of top levels, whose voxel counts are in the color file. A node of level L - 7
// encloses at most 128^3 voxels, so its count always fits in the 24 bits above the mask. HashDAG
// supports up to ten top levels, which are enough for L = 17.
uint32_t top_levels(uint32_t grid_levels) {
  return std::clamp<uint32_t>(grid_levels > 7 ? grid_levels - 7 : 1, 1, 10);
}

// Returns an upper bound on the number of nodes in the top levels of a grid with `grid_levels`
// levels: the DAG's own grid or a coarser one.
uint64_t top_nodes(const SelectedDag& dag, uint32_t grid_levels) {
  uint64_t nodes = 0;
  for (uint32_t level = 0; level < std::min(top_levels(grid_levels), grid_levels - kBrickLevels);
       ++level)
    nodes += dag.node_count(level);
  return nodes;
}

class HashDagWriter {
 public:
  HashDagWriter(const ExportJob& job, const SelectedDag& dag, ExportFile& file)
      : job_(job), dag_(dag), file_(file), top_levels_(top_levels(dag.grid_levels())) {
    bases_.push_back(0);
    for (uint32_t level = 0; level < dag.brick_level(); ++level)
      bases_.push_back(bases_.back() + dag.words(level).size());
    uint64_t nodes = 0;
    for (uint32_t level = 0; level < std::min(top_levels_, dag.brick_level()); ++level) {
      first_top_.push_back(nodes);
      nodes += dag.node_count(level);
    }
    charge_ = MemoryCharge(job.budget, (nodes + 1) * sizeof(uint64_t), "counts of top nodes");
    enclosed_.resize(std::max<uint64_t>(nodes, 1));
  }

  void write() {
    for (size_t axis = 0; axis < 3; ++axis) file_.put(job_.origin(axis));
    for (size_t axis = 0; axis < 3; ++axis) file_.put(job_.origin(axis) + job_.file.edge());
    file_.put(dag_.grid_levels());
    file_.put(dag_.word_count());
    ExportStage stage(job_, "export", dag_.node_count(), "nodes");
    NodeNumbers<uint64_t> below = write_bricks(stage);
    // Goes from the bricks up, because the voxel count of a node is the sum of its children's
    // counts.
    for (uint32_t level = dag_.brick_level(); level-- > 0;) {
      NodeNumbers<uint64_t> counts(job_, dag_, level);
      write_level(level, below, counts, stage);
      below = std::move(counts);
    }
    // A grid of one brick has no node. The only count in the color file is then the number of all
    // voxels.
    if (first_top_.empty()) enclosed_[0] = dag_.voxels();
  }

  void write_colors(ExportFile& colors) const {
    colors.put(top_levels_);
    colors.put<uint64_t>(enclosed_.size());
    for (const uint64_t count : enclosed_) colors.put(count);
    if (job_.has_colors) return write_voxel_colors(colors);
    colors.put<uint64_t>(1);
    colors.put(kGray);
  }

 private:
  void write_voxel_colors(ExportFile& colors) const {
    colors.put(dag_.voxels());
    voxdag_reader::ColorCursor cursor(job_.file);
    ExportStage stage(job_, "export colors", dag_.voxels(), "voxels");
    uint64_t written = 0;
    for_each_brick(job_.dag, job_.selection, [&](const Brick& brick) {
      for_each_cell_of(brick, [&](const Position& cell) {
        const voxdag_reader::Rgb color = color_of_cell(job_, cursor, cell);
        const std::array<uint8_t, 4> bytes = {color.r, color.g, color.b, 255};
        colors.write(std::as_bytes(std::span(bytes)));
      });
      const auto voxels = static_cast<uint64_t>(std::popcount(brick.mask));
      written += voxels;
      stage.advance(voxels);
    });
    require_written(job_, written, dag_.voxels());
  }
  void seek_level(uint32_t level) {
    file_.seek(kHashDagHeaderBytes + bases_[level] * sizeof(uint32_t));
  }

  NodeNumbers<uint64_t> write_bricks(ExportStage& stage) {
    NodeNumbers<uint64_t> counts(job_, dag_, dag_.brick_level());
    seek_level(dag_.brick_level());
    file_.write(std::as_bytes(dag_.words(dag_.brick_level())));
    dag_.for_each_brick([&](uint64_t offset, uint64_t mask) {
      counts[offset] = static_cast<uint64_t>(std::popcount(mask));
      stage.advance(1);
    });
    return counts;
  }

  void write_level(uint32_t level, NodeNumbers<uint64_t>& below, NodeNumbers<uint64_t>& counts,
                   ExportStage& stage) {
    seek_level(level);
    uint64_t top = level < first_top_.size() ? first_top_[level] : 0;
    const uint64_t end = top + dag_.node_count(level);
    dag_.for_each_node(level, [&](uint64_t offset, uint32_t mask, std::span<const uint32_t> nodes) {
      uint64_t count = 0;
      std::array<uint32_t, 9> words;
      for (size_t i = 0; i < nodes.size(); ++i) {
        count += below[nodes[i]];
        words[i + 1] = static_cast<uint32_t>(bases_[level + 1] + nodes[i]);
      }
      counts[offset] = count;
      if (level < top_levels_) {
        if (top == end)
          throw Error(ErrorCode::kCorrupt,
                      job_.file.path() + ": level " + std::to_string(level) +
                          " has more nodes than expected: its header declares " +
                          count_text(dag_.node_count(level)));
        enclosed_[top] = count;
        words[0] = mask | static_cast<uint32_t>(top++) << 8;
      } else if (count < kMaxCount) {
        words[0] = mask | static_cast<uint32_t>(count) << 8;
      } else {
        throw Error(ErrorCode::kLimit,
                    job_.output + ": a node of level " + std::to_string(level) + " encloses " +
                        count_text(count) + " voxels, but HashDAG takes fewer than " +
                        count_text(kMaxCount) + ". " + coarser_options(job_, 17) +
                        " (131072 voxels per edge) fits, or take a smaller " +
                        option_text("region"));
      }
      file_.write(std::as_bytes(std::span(words).first(nodes.size() + 1)));
      stage.advance(1);
    });
  }

  const ExportJob& job_;
  const SelectedDag& dag_;
  ExportFile& file_;
  const uint32_t top_levels_;
  std::vector<uint64_t> bases_;      // word index of the first word of each level
  std::vector<uint64_t> first_top_;  // index of the first node of each top level
  MemoryCharge charge_;
  std::vector<uint64_t> enclosed_;
};

// HashDAG's viewer compiles only for grids of at least 2^10 voxels per edge.
constexpr uint32_t kMinViewerLevels = 10;

std::string scene_depth_note(uint32_t levels) {
  if (levels < kMinViewerLevels)
    return "the viewer of HashDAG takes grids of 1024 voxels per edge or more; its loader reads "
           "this file";
  return "compile the viewer with SCENE_DEPTH " + std::to_string(levels) +
         ", LOAD_UNCOMPRESSED_COLORS 1 and LOAD_COMPRESSED_COLORS 0, and name the files "
         "data/<SCENE>" +
         std::to_string(1u << (levels - kMinViewerLevels)) + "k.basic_dag.*";
}

void require_hashdag_limits(const ExportJob& job, const SelectedDag& dag) {
  CellLimit colored(job, kMaxHashDagColors);
  const auto refuse = [&](const std::string& problem) {
    refuse_size(job, problem, [&](uint32_t level) {
      return dag.size_at(level).words <= kMaxHashDagWords && top_nodes(dag, level) < kMaxCount &&
             (!job.has_colors || colored.fits(level));
    });
  };
  const uint64_t words = dag.word_count(), nodes = top_nodes(dag, dag.grid_levels());
  if (words > kMaxHashDagWords)
    refuse(count_text(words) + " words (" + size_text(4 * words) +
           ") are needed, but the indices of HashDAG reach " + count_text(kMaxHashDagWords));
  if (nodes >= kMaxCount)
    refuse("the top " + std::to_string(top_levels(dag.grid_levels())) + " levels have " +
           count_text(nodes) + " nodes, but HashDAG takes fewer than " + count_text(kMaxCount));
  if (job.has_colors && dag.voxels() > kMaxHashDagColors)
    refuse(count_text(dag.voxels()) +
           " voxels are selected, but HashDAG can store the colors of at most " +
           count_text(kMaxHashDagColors) + " voxels (" + option_text("gray") +
           " leaves the colors out)");
}

}  // namespace

ExportReport write_hashdag(const ExportJob& job) {
  const SelectedDag dag(job);
  require_hashdag_limits(job, dag);
  const uint64_t words = dag.word_count();
  require_space(job, kHashDagHeaderBytes + 4 * words + (job.has_colors ? 4 * dag.voxels() : 0));
  ExportReport report;
  report.voxels = dag.voxels();
  ExportFile file(job.files, job.output);
  ExportFile colors(job.files, job.second_output);
  HashDagWriter writer(job, dag, file);
  writer.write();
  writer.write_colors(colors);
  ExportFile* const written[] = {&file, &colors};
  report.bytes = publish(job, written);
  report.notes.push_back(scene_depth_note(dag.grid_levels()));
  report.add_fact("scene_depth", uint64_t{dag.grid_levels()});
  if (dag.voxels() >> 32)
    report.notes.push_back("HashDAG numbers voxels for colors with 32 bits: " +
                           count_text(dag.voxels()) + " voxels have more");
  return report;
}

}  // namespace voxdag::query
