// Writes MagicaVoxel's .vox, version 150. A model has an edge of at most 256 voxels. So the file
// has one model for each different DAG node with this edge, and one instance of the model for each
// place where the node occurs. With colors, each place has a separate model, because equal nodes
// can have different colors.
//     "VOX " | 150 | MAIN { (SIZE XYZI)... nTRN nGRP (nTRN nSHP)... RGBA }
// MagicaVoxel's z axis points up: voxdag's position (x, y, z) is (x, -z, y) in the file.
#include <algorithm>
#include <array>
#include <bit>
#include <numeric>
#include <optional>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "core/format/bytes.h"
#include "query/export/color/color_palette.h"
#include "query/export/export_file.h"
#include "query/export/selected_dag.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

constexpr uint32_t kModelLevels = 8;  // 256^3 voxels
// Maximum size of a chunk in bytes, because the file stores the size as an int32.
constexpr uint64_t kMaxVoxBytes = (uint64_t{1} << 31) - 1;
// Maximum number of instances, because the ids of the two nodes of each instance are also int32.
constexpr uint64_t kMaxVoxModels = (uint64_t{1} << 31) / 4;
constexpr uint32_t kMagicaVoxelEdge = 2048;         // limit of MagicaVoxel's editor
constexpr uint64_t kModelBytes = 12 + 12 + 12 + 4;  // SIZE chunk, and XYZI chunk without voxels
constexpr uint64_t kChunkHeaderBytes = 12;

// A chunk of the scene graph, built in memory.
class VoxChunk {
 public:
  VoxChunk(const char* id) : id_(id) {}
  VoxChunk& number(int32_t value) {
    ByteSink(bytes_).put(value);
    return *this;
  }
  VoxChunk& text(std::string_view value) {
    number(static_cast<int32_t>(value.size()));
    ByteSink(bytes_).put_bytes(std::as_bytes(std::span(value)));
    return *this;
  }
  VoxChunk& raw(std::span<const std::byte> bytes) {
    ByteSink(bytes_).put_bytes(bytes);
    return *this;
  }
  uint64_t size() const { return kChunkHeaderBytes + bytes_.size(); }
  void write(ExportFile& file) const {
    file.write(std::string_view(id_, 4));
    file.put(static_cast<uint32_t>(bytes_.size()));
    file.put<uint32_t>(0);  // bytes of children
    file.write(bytes_);
  }

 private:
  const char* id_;
  std::vector<std::byte> bytes_;
};

VoxChunk transform_node(int32_t id, int32_t child, const std::string& place) {
  VoxChunk chunk("nTRN");
  chunk.number(id).number(0).number(child).number(-1).number(place.empty() ? -1 : 0).number(1);
  if (place.empty()) return chunk.number(0);
  return chunk.number(1).text("_t").text(place);
}

VoxChunk shape_node(int32_t id, int32_t model) {
  VoxChunk chunk("nSHP");
  chunk.number(id).number(0).number(1).number(model).number(0);
  return chunk;
}

// Returns the chunk with the palette. A voxel with the palette index i has colors[i - 1].
VoxChunk palette_chunk(std::span<const voxdag_reader::Rgb> colors) {
  VoxChunk chunk("RGBA");
  for (size_t i = 0; i < 256; ++i) {
    const voxdag_reader::Rgb color = i < colors.size() ? colors[i] : voxdag_reader::Rgb{};
    const std::array<uint8_t, 4> entry = {color.r, color.g, color.b, 255};
    chunk.raw(std::as_bytes(std::span(entry)));
  }
  return chunk;
}

// The colors of the voxels, in two passes: the constructor collects the colors, and index_of() then
// maps each color to a palette index.
class VoxColors {
 public:
  // `voxels`: number of voxels whose colors are collected, for the progress.
  VoxColors(const ExportJob& job, uint64_t voxels) : job_(job) {
    if (!job.has_colors) return;
    palette_.emplace(job.budget);
    voxdag_reader::ColorCursor cursor(job.file);
    ExportStage stage(job, "find colors", voxels, "voxels");
    for_each_brick(job.dag, job.selection, [&](const Brick& brick) {
      for_each_cell_of(
          brick, [&](const Position& cell) { palette_->add(color_of_cell(job, cursor, cell)); });
      stage.advance(static_cast<uint64_t>(std::popcount(brick.mask)));
    });
    palette_->make();
    cursor_.emplace(job.file);
  }

  size_t count() const { return palette_ ? palette_->colors().size() : 0; }
  VoxChunk palette() const {
    static constexpr voxdag_reader::Rgb kOneGray[] = {{0xb0, 0xb0, 0xb0}};
    return palette_ ? palette_chunk(palette_->colors()) : palette_chunk(kOneGray);
  }
  uint8_t index_of(const Position& cell) {
    if (!palette_) return 1;
    return static_cast<uint8_t>(palette_->index_of(color_of_cell(job_, *cursor_, cell)) + 1);
  }

 private:
  const ExportJob& job_;
  std::optional<ColorPalette> palette_;
  std::optional<voxdag_reader::ColorCursor> cursor_;
};

class VoxWriter {
 public:
  VoxWriter(const ExportJob& job, const SelectedDag& dag)
      : job_(job),
        view_(dag.view()),
        depth_(dag.grid_levels() > kModelLevels ? dag.grid_levels() - kModelLevels : 0),
        edge_(int64_t{1} << (dag.grid_levels() - depth_)),
        level_words_(dag.words(depth_).size()),
        models_(job, dag, depth_),
        charge_(job.budget, dag.node_count(depth_) * sizeof(uint64_t), "the models") {
    // First computes a lower bound from the number of instances. If this bound is already too
    // large, the nodes need not be visited.
    min_bytes_ = 4 + transform_node(0, 0, "0 0 0").size() + shape_node(0, 0).size();
    min_bytes_ *= count_instances(dag);
    if (min_bytes_ > kMaxVoxBytes) return;
    number_models(dag);
    find_instances(0, view_.root(), {0, 0, 0});
  }

  // Returns the size of the file in bytes. If the size is over kMaxVoxBytes, the result is only a
  // lower bound of the size, but also over kMaxVoxBytes.
  uint64_t bytes() const {
    return std::max(min_bytes_, 8 + kChunkHeaderBytes + nodes_bytes() + models_bytes_);
  }
  size_t instance_count() const { return instances_; }
  // Returns the number of voxels in all models. Each model counts once.
  uint64_t model_voxels() const {
    return std::accumulate(voxels_.begin(), voxels_.end(), uint64_t{0});
  }

  void write(ExportFile& file, ExportStage& stage, const SelectedDag& dag, VoxColors& colors) {
    const uint64_t total = bytes();
    file.write("VOX ");
    file.put<uint32_t>(150);
    file.write("MAIN");
    file.put<uint32_t>(0);
    file.put(static_cast<uint32_t>(total - 8 - kChunkHeaderBytes));
    const auto write_next = [&](uint64_t content, const Position& corner, uint64_t voxels) {
      write_model(file, content, corner, voxels, colors);
      stage.advance(voxels);
    };
    if (job_.has_colors) {
      visit_instances(0, view_.root(), {0, 0, 0}, [&](const Position& corner, uint64_t content) {
        write_next(content, corner, voxels_[model_of(content)]);
      });
    } else {
      size_t model = 0;
      for_each_model_node(dag, [&](uint64_t offset) {
        write_next(content_at(offset), {0, 0, 0}, voxels_[model++]);
      });
    }
    write_nodes(file);
    colors.palette().write(file);
    if (file.size() != total)
      throw Error(ErrorCode::kCorrupt, job_.file.path() + ": the .vox file has " +
                                           std::to_string(file.size()) + " bytes, expected " +
                                           std::to_string(total) + ": " + damage_text());
  }

 private:
  template <class Visit>
  void for_each_model_node(const SelectedDag& dag, const Visit& visit) const {
    if (depth_ == dag.brick_level())
      dag.for_each_brick([&](uint64_t offset, uint64_t) { visit(offset); });
    else
      dag.for_each_node(
          depth_, [&](uint64_t offset, uint32_t, std::span<const uint32_t>) { visit(offset); });
  }

  // Returns the content (as in DagView) of the model's node at this word offset. The content
  // differs from the offset only in a grid of one brick.
  uint64_t content_at(uint64_t offset) const {
    return depth_ + kBrickLevels == view_.grid_levels() ? view_.root() : offset;
  }

  uint64_t count_instances(const SelectedDag& dag) const {
    uint64_t count = 1;
    NodeNumbers<uint64_t> below;
    for (uint32_t level = depth_; level-- > 0;) {
      NodeNumbers<uint64_t> counts(job_, dag, level);
      dag.for_each_node(level, [&](uint64_t at, uint32_t, std::span<const uint32_t> children) {
        count = 0;
        for (const uint32_t child : children) count += level + 1 == depth_ ? 1 : below[child];
        counts[at] = count;
      });
      below = std::move(counts);
    }
    return count;
  }

  void number_models(const SelectedDag& dag) {
    voxels_.reserve(dag.node_count(depth_));
    uint64_t total = 0;
    for_each_model_node(dag, [&](uint64_t offset) {
      // Stops counting when the voxels alone, which take 4 bytes each, exceed the maximum size.
      if (4 * total > kMaxVoxBytes) return;
      models_[offset] = static_cast<uint32_t>(voxels_.size());
      uint64_t voxels = 0;
      visit_bricks(depth_, content_at(offset), {0, 0, 0}, [&](const Brick& brick) {
        voxels += static_cast<uint64_t>(std::popcount(brick.mask));
      });
      voxels_.push_back(voxels);
      total += voxels;
      job_.cancel.check();
    });
  }

  template <class Visit>
  void visit_bricks(uint32_t depth, uint64_t content, const Position& corner,
                    const Visit& visit) const {
    if (depth + kBrickLevels == view_.grid_levels()) return visit(Brick{corner, content});
    const DagView::Children children = view_.children(depth, content);
    const int64_t half = int64_t{1} << (view_.grid_levels() - depth - 1);
    for (int i = 0; i < 8; ++i)
      if (children.has(i))
        visit_bricks(depth + 1, view_.content(depth, children, i), child_corner(corner, i, half),
                     visit);
  }

  // Returns the number of the model that has the voxels of the node with this content (DagView).
  uint32_t model_of(uint64_t content) {
    return depth_ + kBrickLevels == view_.grid_levels() ? 0 : models_[content];
  }

  // Calls visit(corner, content) for each instance of a model: `corner` is the instance's low
  // corner, and `content` is the content (DagView) of the model's node.
  template <class Visit>
  void visit_instances(uint32_t depth, uint64_t content, const Position& corner,
                       const Visit& visit) {
    if (depth == depth_) {
      job_.cancel.check();
      if (depth_ + kBrickLevels != view_.grid_levels() && content >= level_words_)
        refuse_missing_node(job_.file.path(), depth_, content);
      return visit(corner, content);
    }
    const DagView::Children children = view_.children(depth, content);
    const int64_t half = int64_t{1} << (view_.grid_levels() - depth - 1);
    for (int i = 0; i < 8; ++i)
      if (children.has(i))
        visit_instances(depth + 1, view_.content(depth, children, i), child_corner(corner, i, half),
                        visit);
  }

  void find_instances(uint32_t depth, uint64_t content, const Position& corner) {
    visit_instances(depth, content, corner, [&](const Position& at, uint64_t of_instance) {
      instance_bytes_ += transform_node(0, 0, place_text(at)).size() + shape_node(0, 0).size();
      ++instances_;
      if (job_.has_colors) models_bytes_ += model_bytes(voxels_[model_of(of_instance)]);
    });
    if (job_.has_colors) return;
    for (const uint64_t voxels : voxels_) models_bytes_ += model_bytes(voxels);
  }

  // Returns the position of an instance's center as text. The center of the grid is at
  // MagicaVoxel's x = y = 0, and its floor at z = 0.
  std::string place_text(const Position& corner) const {
    const int64_t half = edge_ / 2, middle = int64_t{1} << (view_.grid_levels() - 1);
    return std::to_string(corner[0] + half - middle) + " " +
           std::to_string(middle - corner[2] - half) + " " + std::to_string(corner[1] + half);
  }

  static uint64_t model_bytes(uint64_t voxels) { return kModelBytes + 4 * voxels; }

  uint64_t nodes_bytes() const {
    return transform_node(0, 1, "").size() + kChunkHeaderBytes + 12 + 4 * instances_ +
           instance_bytes_ + palette_chunk({}).size();
  }

  void write_model(ExportFile& file, uint64_t content, const Position& place, uint64_t voxels,
                   VoxColors& colors) const {
    file.write("SIZE");
    file.put<uint32_t>(12);
    file.put<uint32_t>(0);
    for (int axis = 0; axis < 3; ++axis) file.put(static_cast<uint32_t>(edge_));
    file.write("XYZI");
    file.put(static_cast<uint32_t>(4 + 4 * voxels));
    file.put<uint32_t>(0);
    file.put(static_cast<uint32_t>(voxels));
    visit_bricks(depth_, content, {0, 0, 0}, [&](const Brick& brick) {
      for_each_cell_of(brick, [&](const Position& cell) {
        const uint8_t index =
            colors.index_of({place[0] + cell[0], place[1] + cell[1], place[2] + cell[2]});
        const std::array<uint8_t, 4> voxel = {static_cast<uint8_t>(cell[0]),
                                              static_cast<uint8_t>(edge_ - 1 - cell[2]),
                                              static_cast<uint8_t>(cell[1]), index};
        file.write(std::as_bytes(std::span(voxel)));
      });
    });
  }

  void write_nodes(ExportFile& file) {
    transform_node(0, 1, "").write(file);
    file.write("nGRP");
    file.put(static_cast<uint32_t>(12 + 4 * instances_));
    file.put<uint32_t>(0);
    file.put<int32_t>(1);
    file.put<int32_t>(0);
    file.put(static_cast<int32_t>(instances_));
    for (size_t i = 0; i < instances_; ++i) file.put(static_cast<int32_t>(2 + 2 * i));
    int32_t id = 2;
    visit_instances(0, view_.root(), {0, 0, 0}, [&](const Position& corner, uint64_t content) {
      const int32_t model = job_.has_colors ? id / 2 - 1 : static_cast<int32_t>(model_of(content));
      transform_node(id, id + 1, place_text(corner)).write(file);
      shape_node(id + 1, model).write(file);
      id += 2;
    });
  }

  const ExportJob& job_;
  const DagView view_;
  const uint32_t depth_;  // depth of the models' nodes
  const int64_t edge_;    // edge of a model
  const uint64_t level_words_;
  NodeNumbers<uint32_t> models_;
  MemoryCharge charge_;
  std::vector<uint64_t> voxels_;  // number of voxels in each model
  uint64_t min_bytes_ = 0, models_bytes_ = 0;
  size_t instances_ = 0;
  uint64_t instance_bytes_ = 0;
};

}  // namespace

ExportReport write_vox(const ExportJob& job) {
  const SelectedDag dag(job);
  VoxWriter writer(job, dag);
  const uint64_t bytes = writer.bytes();
  if (bytes > kMaxVoxBytes || writer.instance_count() > kMaxVoxModels) {
    // Suggests coarser grids that fit even if no models are shared. A voxel takes 4 bytes. Three
    // fourths of kMaxVoxBytes are for voxels, and the last fourth is for models and instances.
    CellLimit cells(job, kMaxVoxBytes / 16 * 3);
    refuse_size(
        job,
        size_text(bytes) + " or more are needed" +
            (job.has_colors ? " with colors (" + option_text("gray") + " leaves them out)" : "") +
            ", but the chunks of a .vox file have at most " + size_text(kMaxVoxBytes),
        [&](uint32_t level) { return cells.fits(level); });
  }
  require_space(job, bytes);
  ExportReport report;
  report.voxels = dag.voxels();
  VoxColors colors(job, dag.voxels());
  ExportFile file(job.files, job.output);
  const uint64_t voxels = job.has_colors ? dag.voxels() : writer.model_voxels();
  ExportStage stage(job, "export", voxels, "voxels");
  writer.write(file, stage, dag, colors);
  ExportFile* const written[] = {&file};
  report.bytes = publish(job, written);
  report.notes.push_back((job.turn.is_none() ? "z is up: a voxel (x, y, z) is at (x, -z, y); "
                                             : "a voxel (x, y, z) is at (x, y, z); ") +
                         count_text(writer.instance_count()) + " instances");
  report.add_fact("instances", writer.instance_count());
  if (job.has_colors) {
    report.add_fact("palette_colors", colors.count());
    report.notes.push_back("a palette of " + count_text(colors.count()) +
                           " colors; each place has a separate model (" + option_text("gray") +
                           " shares equal models)");
  }
  if (dag.grid_levels() > std::bit_width(kMagicaVoxelEdge) - 1)
    report.notes.emplace_back(
        "MagicaVoxel shows at most 2048 voxels per edge; other readers take all");
  return report;
}

}  // namespace voxdag::query
