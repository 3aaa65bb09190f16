#include "scene/obj/obj_scene.h"

#include <utility>

#include "scene/indexed/indexed_cursor.h"
#include "scene/obj/file/obj_file.h"
#include "scene/obj/materials/materials.h"
#include "scene/obj/obj_mesh.h"

namespace voxdag::obj {
namespace {

class ObjScene : public TriangleSource {
 public:
  ObjScene(FileSystem& files, std::unique_ptr<ReadableFile> file, const SceneOptions& options,
           MemoryBudget& budget, const CancelToken& cancel)
      : obj_(std::move(file), budget, cancel),
        materials_(read_materials(files, obj_, budget)),
        options_(options),
        budget_(budget),
        cancel_(cancel) {}

  std::unique_ptr<TriangleCursor> open(unsigned cursors) override {
    if (obj_.triangles() == 0) return std::make_unique<NoTriangles>();
    return std::make_unique<IndexedCursor>(
        std::make_unique<ObjMesh>(obj_, materials_, cursors, budget_), options_.skip_invalid,
        cursors, budget_, cancel_);
  }
  uint64_t declared_triangles() const override { return obj_.triangles(); }
  SceneMaterials materials() const override { return materials_.scene; }
  uint32_t material_count() const override {
    return static_cast<uint32_t>(materials_.scene.materials.size());
  }
  std::vector<SourceFile> files() const override {
    std::vector<SourceFile> all{{obj_.file().path(), obj_.file().identity()}};
    all.insert(all.end(), materials_.files.begin(), materials_.files.end());
    return all;
  }
  std::vector<Warning> warnings() const override { return obj_.warnings(); }

 private:
  const ObjFile obj_;
  const ObjMaterials materials_;
  const SceneOptions options_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
};

}  // namespace

std::unique_ptr<TriangleSource> open_obj(FileSystem& files, std::unique_ptr<ReadableFile> file,
                                         const SceneOptions& options, MemoryBudget& budget,
                                         const CancelToken& cancel) {
  return std::make_unique<ObjScene>(files, std::move(file), options, budget, cancel);
}

}  // namespace voxdag::obj
