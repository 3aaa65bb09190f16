#include "scene/ply/ply_scene.h"

#include <algorithm>
#include <array>
#include <utility>

#include "scene/indexed/indexed_cursor.h"
#include "scene/ply/ply_file.h"
#include "scene/ply/ply_mesh.h"
#include "scene/ply/ply_points.h"
#include "scene/ply/surfaces.h"
#include "scene/points/point_scene.h"

namespace voxdag::ply {
namespace {

class PlyScene : public TriangleSource {
 public:
  PlyScene(FileSystem& files, std::unique_ptr<const PlyFile> ply, const SceneOptions& options,
           MemoryBudget& budget, const CancelToken& cancel)
      : ply_(std::move(ply)),
        surfaces_(std::make_unique<Surfaces>(files, *ply_, budget, cancel)),
        options_(options),
        budget_(budget),
        cancel_(cancel) {}

  std::unique_ptr<TriangleCursor> open(unsigned cursors) override {
    if (ply_->triangles() == 0) return std::make_unique<NoTriangles>();
    return std::make_unique<IndexedCursor>(
        std::make_unique<PlyMesh>(*ply_, *surfaces_, cursors, budget_), options_.skip_invalid,
        cursors, budget_, cancel_);
  }
  uint64_t declared_triangles() const override { return ply_->triangles(); }
  SceneMaterials materials() const override { return surfaces_->values().scene; }
  uint32_t material_count() const override { return surfaces_->materials(); }
  std::vector<SourceFile> files() const override {
    return {{ply_->file().path(), ply_->file().identity()}};
  }
  std::vector<Warning> warnings() const override { return ply_->warnings(); }

 private:
  const std::unique_ptr<const PlyFile> ply_;
  const std::unique_ptr<Surfaces> surfaces_;
  const SceneOptions options_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
};

}  // namespace

bool is_ply(const ReadableFile& file) {
  std::array<char, 256> first{};
  const auto size = static_cast<size_t>(std::min<uint64_t>(file.size(), first.size()));
  file.read_at(0, std::as_writable_bytes(std::span(first).first(size)));
  return first_line_bytes({first.data(), size}) > 0;
}

std::unique_ptr<TriangleSource> open_ply(FileSystem& files, std::unique_ptr<ReadableFile> file,
                                         const SceneOptions& options, MemoryBudget& budget,
                                         const CancelToken& cancel) {
  auto ply = std::make_unique<const PlyFile>(std::move(file), budget, cancel);
  if (ply->has_primitives())
    return std::make_unique<PlyScene>(files, std::move(ply), options, budget, cancel);
  return points::make_point_scene(
      std::make_unique<VertexPoints>(files, std::move(ply), budget, cancel), options, budget,
      cancel);
}

}  // namespace voxdag::ply
