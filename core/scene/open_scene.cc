// Scenes that consist of the default scenes of glTF files, one after the other.
#include <memory>
#include <vector>

#include "core/base/error.h"
#include "core/base/integers.h"
#include "core/scene/gltf/document/check_document.h"
#include "core/scene/gltf/document/read_document.h"
#include "core/scene/gltf/triangle_reader.h"
#include "core/scene/triangle_source.h"

namespace voxdag {
namespace {

// An open scene file and its checked document.
struct SceneFile {
  SceneFile(FileSystem& files, const std::string& path, MemoryBudget& budget,
            const CancelToken& cancel)
      : file(files.open_read(path)), document(gltf::read_document(*file, budget, cancel)) {
    gltf::check_document(document);
    buffers = std::make_unique<gltf::BufferReader>(files, *file, document, budget);
  }

  const std::unique_ptr<ReadableFile> file;
  gltf::Document document;
  std::unique_ptr<gltf::BufferReader> buffers;
};

// Declared triangles of the scene to draw, every instance counted.
uint128 count_triangles(const gltf::Document& document, MemoryBudget& budget) {
  uint128 total = 0;
  gltf::NodeWalk walk(document, budget);
  while (walk.next()) {
    const gltf::Node& node = document.nodes[static_cast<size_t>(walk.node())];
    uint128 per_instance = 0;
    for (const auto& p : document.meshes[static_cast<size_t>(node.mesh)].primitives)
      per_instance += gltf::triangle_count(document, p);
    total += per_instance * gltf::instance_count(document, node);
  }
  return total;
}

class GltfScene : public TriangleSource {
 public:
  GltfScene(FileSystem& files, const std::vector<std::string>& paths, const SceneOptions& options,
            MemoryBudget& budget, const CancelToken& cancel)
      : options_(options), budget_(budget), cancel_(cancel) {
    uint128 total = 0;
    for (const std::string& path : paths) {
      cancel.check();
      files_.push_back(std::make_unique<SceneFile>(files, path, budget, cancel));
      total += count_triangles(files_.back()->document, budget);
      if (total > INT64_MAX)
        throw Error(ErrorCode::kLimit, path + ": over 2^63 triangles, instances counted");
    }
    declared_ = static_cast<uint64_t>(total);
  }

  void for_each_batch_from(uint64_t first, const Visitor& visit) override {
    position_ = {};
    gltf::Batch batch(visit, position_, first, budget_, cancel_);
    for (const auto& f : files_)
      gltf::TriangleReader(f->document, *f->buffers, budget_, options_.skip_invalid, batch).run();
    batch.flush();
  }
  uint64_t position() const override { return position_.triangles; }
  uint64_t declared_triangles() const override { return declared_; }
  uint64_t invalid_triangles() const override { return position_.invalid; }
  std::vector<SourceFile> files() const override {
    std::vector<SourceFile> all;
    for (const auto& f : files_) all.push_back({f->file->path(), f->file->identity()});
    for (const auto& f : files_)
      for (const auto& [buffer, file] : f->buffers->external_files()) all.push_back(file);
    return all;
  }
  std::vector<std::string> warnings() const override {
    std::vector<std::string> all;
    for (const auto& f : files_) {
      const gltf::Document& d = f->document;
      all.insert(all.end(), d.warnings.begin(), d.warnings.end());
      if (d.further_warnings > 0)
        all.push_back(d.path + ": " + std::to_string(d.further_warnings) + " further warnings");
    }
    return all;
  }

 private:
  const SceneOptions options_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  std::vector<std::unique_ptr<SceneFile>> files_;
  uint64_t declared_ = 0;
  gltf::PassPosition position_;
};

}  // namespace

std::unique_ptr<TriangleSource> open_scene(FileSystem& files, const std::vector<std::string>& paths,
                                           const SceneOptions& options, MemoryBudget& budget,
                                           const CancelToken& cancel) {
  return std::make_unique<GltfScene>(files, paths, options, budget, cancel);
}

}  // namespace voxdag
