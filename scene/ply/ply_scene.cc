#include "scene/ply/ply_scene.h"

#include <array>
#include <string_view>
#include <utility>

#include "scene/indexed/indexed_cursor.h"
#include "scene/ply/ply_file.h"
#include "scene/ply/ply_mesh.h"

namespace voxdag::ply {
namespace {

class PlyScene : public TriangleSource {
 public:
  PlyScene(std::unique_ptr<ReadableFile> file, const SceneOptions& options, MemoryBudget& budget,
           const CancelToken& cancel)
      : ply_(std::move(file), budget, cancel),
        options_(options),
        budget_(budget),
        cancel_(cancel) {}

  std::unique_ptr<TriangleCursor> open(unsigned cursors) override {
    if (ply_.triangles() == 0) return std::make_unique<NoTriangles>();
    return std::make_unique<IndexedCursor>(std::make_unique<PlyMesh>(ply_, budget_),
                                           options_.skip_invalid, cursors, budget_, cancel_);
  }
  uint64_t declared_triangles() const override { return ply_.triangles(); }
  std::vector<SourceFile> files() const override {
    return {{ply_.file().path(), ply_.file().identity()}};
  }
  std::vector<std::string> warnings() const override { return ply_.warnings(); }

 private:
  const PlyFile ply_;
  const SceneOptions options_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
};

}  // namespace

bool is_ply(const ReadableFile& file) {
  std::array<char, 4> first{};
  if (file.size() < first.size()) return false;
  file.read_at(0, std::as_writable_bytes(std::span(first)));
  const std::string_view text(first.data(), first.size());
  return text == "ply\n" || text == "ply\r";
}

std::unique_ptr<TriangleSource> open_ply(FileSystem&, std::unique_ptr<ReadableFile> file,
                                         const SceneOptions& options, MemoryBudget& budget,
                                         const CancelToken& cancel) {
  return std::make_unique<PlyScene>(std::move(file), options, budget, cancel);
}

}  // namespace voxdag::ply
