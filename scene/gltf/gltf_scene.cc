#include "scene/gltf/gltf_scene.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/integers.h"
#include "scene/gltf/document/check_document.h"
#include "scene/gltf/document/read_document.h"
#include "scene/gltf/materials/document_materials.h"
#include "scene/gltf/materials/image_sources.h"
#include "scene/gltf/mesh_data/draco_counts.h"
#include "scene/gltf/mesh_data/index_restarts.h"
#include "scene/gltf/mesh_data/skin_weights.h"
#include "scene/gltf/triangle_reader.h"

namespace voxdag::gltf {
namespace {

// Corrects the numbers of vertices and faces of Draco primitives (draco_counts.h). Uses a temporary
// reader, because the readers of the scene rely on the correct numbers.
void correct_counts(FileSystem& files, const ReadableFile& file, Document& document,
                    MemoryBudget& budget) {
  if (std::ranges::none_of(document.buffers, [](const BufferSource& b) { return !!b.draco; }))
    return;
  ExternalFiles opened(file.path(), budget);
  DecodedBuffers decoded(files, "", document, budget);
  BufferReader buffers(files, file, document, opened, decoded, budget, 1);
  correct_draco_counts(document, buffers);
}

Document read_checked(FileSystem& files, ReadableFile& file, const SceneOptions& options,
                      MemoryBudget& budget, const CancelToken& cancel) {
  Document document = read_document(file, options.ignored_extensions, budget, cancel);
  check_document(document);
  correct_counts(files, file, document, budget);
  resolve_materials(document);
  return document;
}

// Returns the number of triangles that the scene declares, including every instance.
uint64_t count_triangles(const Document& document, MemoryBudget& budget) {
  uint128 total = 0;
  NodeWalk walk(document, budget);
  while (walk.next()) {
    const Node& node = document.nodes[static_cast<size_t>(walk.node())];
    uint128 per_instance = 0;
    for (const auto& p : document.meshes[static_cast<size_t>(node.mesh)].primitives)
      per_instance += triangle_count(document, p);
    total += per_instance * instance_count(document, node);
  }
  if (total > INT64_MAX)
    throw Error(
        ErrorCode::kLimit,
        document.path + ": the scene has over 2^63 triangles, including instances: expected fewer");
  return static_cast<uint64_t>(total);
}

class GltfCursor : public TriangleCursor {
 public:
  GltfCursor(BufferReader buffers, const Document& document, const ReaderOptions& options,
             MemoryBudget& budget, const CancelToken& cancel)
      : buffers_(std::move(buffers)), reader_(document, buffers_, options, budget, cancel) {}

  void read(uint64_t first, uint64_t count, const Visitor& visit) override {
    reader_.read(first, count, nullptr, visit);
  }
  void read_snapped(uint64_t first, uint64_t count, const Grid& grid,
                    const Visitor& visit) override {
    reader_.read(first, count, &grid, visit);
  }
  void read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit) override {
    reader_.read_surfaces(first, count, visit);
  }
  WorldBounds read_bounds(uint64_t first, uint64_t count) override {
    return reader_.read_bounds(first, count);
  }

 private:
  BufferReader buffers_;
  TriangleReader reader_;
};

class GltfScene : public TriangleSource {
 public:
  GltfScene(FileSystem& files, std::unique_ptr<ReadableFile> file, const SceneOptions& options,
            MemoryBudget& budget, const CancelToken& cancel)
      : files_(files),
        options_(options),
        budget_(budget),
        cancel_(cancel),
        file_(std::move(file)),
        document_(read_checked(files, *file_, options, budget, cancel)),
        external_files_(file_->path(), budget),
        decoded_(files, options.scratch_path, document_, budget) {
    BufferReader reader = buffers(1);
    reader.check_lengths();
    index_restarts(document_, reader);
    warnings_ = document_.warnings;
    warn_of_weights(document_, reader, warnings_);
    declared_ = count_triangles(document_, budget);
  }

  std::unique_ptr<TriangleCursor> open(unsigned cursors) override {
    return std::make_unique<GltfCursor>(buffers(cursors), document_,
                                        ReaderOptions{options_.skip_invalid, cursors}, budget_,
                                        cancel_);
  }
  uint64_t declared_triangles() const override { return declared_; }
  SceneMaterials materials() const override {
    const DocumentMaterials& listed = *document_.materials;
    SceneMaterials out{listed.materials, {}, listed.warnings, {}};
    // The file's materials come first, and have the numbers 0, 1, 2, ... The additional materials
    // repeat one of these numbers or have none, so they add no name.
    for (const Material& material : listed.materials)
      if (material.number == out.names.size()) out.names.push_back(material.name);
    for (int image : listed.images)
      out.images.push_back(find_image(files_, *file_, document_, image));
    return out;
  }
  uint32_t material_count() const override {
    return static_cast<uint32_t>(document_.materials->materials.size());
  }
  std::vector<SourceFile> files() const override {
    std::vector<SourceFile> all{{file_->path(), file_->identity()}};
    for (const SourceFile& file : external_files_.all()) all.push_back(file);
    return all;
  }
  UsedOptions used_options() const override {
    return {.ignored_extensions = document_.ignored_extensions};
  }
  std::vector<Warning> warnings() const override { return warnings_.list(); }

 private:
  BufferReader buffers(unsigned readers) {
    return {files_, *file_, document_, external_files_, decoded_, budget_, readers};
  }

  FileSystem& files_;
  const SceneOptions options_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  const std::unique_ptr<ReadableFile> file_;
  Document document_;
  ExternalFiles external_files_;
  DecodedBuffers decoded_;
  WarningList warnings_;
  uint64_t declared_ = 0;
};

}  // namespace

std::unique_ptr<TriangleSource> open_gltf(FileSystem& files, std::unique_ptr<ReadableFile> file,
                                          const SceneOptions& options, MemoryBudget& budget,
                                          const CancelToken& cancel) {
  return std::make_unique<GltfScene>(files, std::move(file), options, budget, cancel);
}

}  // namespace voxdag::gltf
