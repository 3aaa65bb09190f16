#include "query/export/chunks/export_chunks.h"

#include <algorithm>
#include <array>
#include <bit>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/fields/json_text.h"
#include "core/format/checksum.h"
#include "query/export/dag_export.h"
#include "query/export/export_job.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

using Json = nlohmann::ordered_json;
constexpr uint64_t kMinChunkEdge = 4;

// A chunk. `place` is its low corner, in units of a chunk's edge. `selection` selects its cells.
struct Chunk {
  Position place;
  Selection selection;
};

// Finds the chunks of one level that have contents (DagExport::has_contents()). `edge` is the edge
// of a chunk, in cells.
class ChunkFinder {
 public:
  ChunkFinder(const DagExport& dag, const Selection& selection, uint64_t edge)
      : dag_(dag), selection_(selection), edge_(static_cast<int64_t>(edge)) {}

  // Returns the chunks, in Morton order. With `is_level_set`, the export is a level set, which also
  // has contents in some chunks without set cells.
  std::vector<Chunk> find(bool is_level_set) {
    const int64_t edge = int64_t{1} << selection_.grid_levels;
    if (dag_.dag().empty()) return {};
    if (is_level_set)
      visit_band({0, 0, 0}, edge);
    else
      visit(0, dag_.dag().root(), {0, 0, 0}, edge);
    return std::move(chunks_);
  }

 private:
  void visit(uint32_t depth, uint64_t content, const Position& corner, int64_t edge) {
    if (!selection_.region.intersects(corner, edge)) return;
    if (edge <= edge_) return add(corner, edge);
    const DagView::Children children = dag_.dag().children(depth, content);
    for (int i = 0; i < 8; ++i)
      if (children.has(i))
        visit(depth + 1, dag_.dag().content(depth, children, i), child_corner(corner, i, edge / 2),
              edge / 2);
  }
  void visit_band(const Position& corner, int64_t edge) {
    if (!selection_.region.intersects(corner, edge)) return;
    if (edge <= edge_) return add(corner, edge);
    const Region cube{corner, {corner[0] + edge, corner[1] + edge, corner[2] + edge}};
    if (!dag_.has_contents({selection_.grid_levels, cube})) return;
    for (int i = 0; i < 8; ++i) visit_band(child_corner(corner, i, edge / 2), edge / 2);
  }
  void add(const Position& corner, int64_t edge) {
    Chunk chunk{{}, {selection_.grid_levels, selection_.region}};
    for (size_t axis = 0; axis < 3; ++axis) {
      chunk.place[axis] = corner[axis] / edge;
      Region& region = chunk.selection.region;
      region.low[axis] = std::max(region.low[axis], corner[axis]);
      region.high[axis] = std::min(region.high[axis], corner[axis] + edge);
    }
    if (dag_.has_contents(chunk.selection)) chunks_.push_back(chunk);
  }

  const DagExport& dag_;
  const Selection selection_;
  const int64_t edge_;
  std::vector<Chunk> chunks_;
};

void check_chunks(const ChunksRequest& request) {
  if (!std::has_single_bit(request.edge) || request.edge < kMinChunkEdge)
    throw Error(ErrorCode::kInvalidInput, option_text("chunks", std::to_string(request.edge)) +
                                              ": expected a power of two of at least 4");
  const uint32_t selected = request.request.selection.grid_levels;
  if (request.levels < 1 || request.levels + kBrickLevels > selected + 1)
    throw Error(ErrorCode::kInvalidInput, option_text("levels", std::to_string(request.levels)) +
                                              ": expected 1 to " +
                                              std::to_string(selected + 1 - kBrickLevels) +
                                              ", because the coarsest grid has 4 voxels per edge");
}

void check_folder(FileSystem& files, const ExportRequest& request) {
  if (!files.exists(request.output) || request.replace || files.list(request.output).empty())
    return;
  throw Error(ErrorCode::kInvalidInput, request.output +
                                            ": the folder is not empty: expected a new or empty "
                                            "folder, or " +
                                            option_text("force") + " to replace files in it");
}

class ChunkWriter {
 public:
  ChunkWriter(FileSystem& files, const voxdag_reader::File& file, const ChunksRequest& request)
      : files_(files), file_(file), request_(request), dag_(file, request.request) {}

  ChunksReport run(Progress& progress, const CancelToken& cancel) {
    dag_.verify(progress, cancel);
    std::vector<std::vector<Chunk>> levels;
    uint64_t count = 0;
    const bool is_level_set = request_.request.options.grid == GridKind::kSdf;
    const Selection& selected = request_.request.selection;
    for (uint32_t up = 0; up < request_.levels; ++up) {
      const Selection selection = coarser(selected, selected.grid_levels - up);
      levels.push_back(ChunkFinder(dag_, selection, request_.edge).find(is_level_set));
      count += levels.back().size();
    }
    progress.begin_stage("export", count, "chunks");
    Json list = Json::array();
    for (const auto& chunks : levels) {
      Json entries = Json::array();
      for (const Chunk& chunk : chunks) {
        entries.push_back(write(chunk, cancel));
        progress.advance(1);
      }
      const uint32_t level = selected.grid_levels - static_cast<uint32_t>(list.size());
      list.push_back(
          {{"level", level}, {"voxel_size", cell_edge(level)}, {"chunks", std::move(entries)}});
    }
    progress.end_stage();
    write_manifest(std::move(list));
    return report_;
  }
  // Removes the files and the folders that this export has created. Ignores errors, because the
  // caller already handles an error. A folder with files of other programs remains.
  void undo() {
    for (const std::string& path : written_) ignore_errors([&] { files_.remove(path); });
    for (; !folders_.empty(); folders_.pop_back())
      ignore_errors([&] { files_.remove_directory(folders_.back()); });
  }

 private:
  double cell_edge(uint32_t level) const {
    return file_.edge() / static_cast<double>(int64_t{1} << level);
  }
  Json write(const Chunk& chunk, const CancelToken& cancel) {
    const ExportFormat& format = *request_.request.format;
    const uint32_t level = chunk.selection.grid_levels;
    const std::string folder = "L" + std::to_string(level);
    const auto& [x, y, z] = chunk.place;
    const std::string name = folder + "/" + std::to_string(x) + "_" + std::to_string(y) + "_" +
                             std::to_string(z) +
                             (format.suffix ? format.suffix : std::string(".") + format.name);
    make_folder(request_.request.output);
    make_folder(request_.request.output + "/" + folder);
    NoProgress progress;
    const ExportReport report =
        dag_.write(files_, chunk.selection, request_.request.output + "/" + name, progress, cancel);
    written_.insert(written_.end(), report.files.begin(), report.files.end());
    ++report_.chunks;
    report_.voxels += report.voxels;
    report_.bytes += report.bytes;
    Json list = Json::array();
    for (const std::string& path : report.files) {
      const auto file = files_.open_own(path);
      list.push_back({{"path", path.substr(request_.request.output.size() + 1)},
                      {"bytes", file->size()},
                      {"sha256", sha256_of_file(*file, cancel)}});
    }
    return {{"place", chunk.place},
            {"low", chunk.selection.region.low},
            {"high", chunk.selection.region.high},
            {"box", world_box(chunk.selection)},
            {"voxels", report.voxels},
            {"files", std::move(list)}};
  }
  template <class Action>
  static void ignore_errors(const Action& action) {
    try {
      action();
    } catch (const Error&) {
    }
  }
  // Makes a folder and its missing parents.
  void make_folder(const std::string& path) {
    if (files_.exists(path)) return;
    make_folder(parent_directory(path));
    files_.make_directories(path);
    folders_.push_back(path);
  }
  std::array<double, 6> world_box(const Selection& selection) const {
    std::array<double, 6> box{};
    for (size_t axis = 0; axis < 3; ++axis) {
      const double edge = cell_edge(selection.grid_levels), low = file_.origin()[axis];
      box[axis] = low + static_cast<double>(selection.region.low[axis]) * edge;
      box[axis + 3] = low + static_cast<double>(selection.region.high[axis]) * edge;
    }
    return box;
  }
  void write_manifest(Json levels) {
    const std::string& path = file_.path();
    const Json manifest = {{"format", request_.request.format->name},
                           {"source", path.substr(path.rfind('/') + 1)},
                           {"origin", file_.origin()},
                           {"edge", file_.edge()},
                           {"chunk_voxels", request_.edge},
                           {"levels", std::move(levels)}};
    report_.manifest = request_.request.output + "/manifest.json";
    make_folder(request_.request.output);
    write_file_atomically(files_, report_.manifest, json_text(manifest, 1) + "\n");
  }

  FileSystem& files_;
  const voxdag_reader::File& file_;
  const ChunksRequest& request_;
  DagExport dag_;
  ChunksReport report_;
  std::vector<std::string> written_, folders_;  // created files and folders
};

}  // namespace

ChunksReport export_chunks(FileSystem& files, const voxdag_reader::File& file,
                           const ChunksRequest& request, Progress& progress,
                           const CancelToken& cancel) {
  check_grid(request.request.selection, file.grid_levels());
  check_chunks(request);
  check_folder(files, request.request);
  ChunkWriter writer(files, file, request);
  try {
    return writer.run(progress, cancel);
  } catch (...) {
    writer.undo();
    throw;
  }
}

}  // namespace voxdag::query
