// Scenes that consist of glTF files (the default scene of each) and PLY files, one after the other.
#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/base/error.h"
#include "core/base/integers.h"
#include "scene/chained_scene.h"
#include "scene/gltf/document/check_document.h"
#include "scene/gltf/document/read_document.h"
#include "scene/gltf/looks/image_sources.h"
#include "scene/gltf/looks/looks.h"
#include "scene/gltf/triangle_reader.h"
#include "scene/ply/header.h"
#include "scene/ply/ply_scene.h"
#include "scene/triangle_source.h"

namespace voxdag {
namespace {

gltf::Document checked(gltf::Document document) {
  gltf::check_document(document);
  gltf::resolve_looks(document);
  return document;
}

// An open scene file and its checked document.
struct SceneFile {
  SceneFile(FileSystem& files, const std::string& path, const SceneOptions& options,
            MemoryBudget& budget, const CancelToken& cancel)
      : file(files.open_read(path)),
        document(checked(gltf::read_document(*file, budget, cancel))),
        external_files(path, budget),
        decoded(files, options.scratch_path, document, budget) {
    gltf::BufferReader(files, *file, document, external_files, decoded, budget, 1).check_lengths();
  }

  const std::unique_ptr<ReadableFile> file;
  gltf::Document document;
  gltf::ExternalFiles external_files;
  gltf::DecodedBuffers decoded;
  uint64_t first_triangle = 0, end_triangle = 0;  // of those that the scene declares
  uint32_t first_material = 0;                    // of those of the scene
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

class GltfCursor : public TriangleCursor {
 public:
  GltfCursor(FileSystem& files, std::span<const std::unique_ptr<SceneFile>> scene_files,
             const gltf::ReaderOptions& options, MemoryBudget& budget, const CancelToken& cancel)
      : files_(files),
        scene_files_(scene_files),
        options_(options),
        budget_(budget),
        cancel_(cancel) {}

  void read(uint64_t first, uint64_t count, const Visitor& visit) override {
    for_each_file(first, count, [&](SceneFile& file, uint64_t begin, uint64_t n) {
      reader_of(file).read(begin, n, nullptr, visit);
    });
  }
  void read_snapped(uint64_t first, uint64_t count, const Grid& grid,
                    const Visitor& visit) override {
    for_each_file(first, count, [&](SceneFile& file, uint64_t begin, uint64_t n) {
      reader_of(file).read(begin, n, &grid, visit);
    });
  }
  void read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit) override {
    for_each_file(first, count, [&](SceneFile& file, uint64_t begin, uint64_t n) {
      reader_of(file).read_surfaces(begin, n, with_material_offset(file.first_material, visit));
    });
  }
  WorldBounds read_bounds(uint64_t first, uint64_t count) override {
    WorldBounds bounds;
    for_each_file(first, count, [&](SceneFile& file, uint64_t begin, uint64_t n) {
      bounds.add(reader_of(file).read_bounds(begin, n));
    });
    return bounds;
  }

 private:
  // Calls body(file, first, count) for each part of the triangles that one file declares.
  template <class Body>
  void for_each_file(uint64_t first, uint64_t count, const Body& body) {
    const uint64_t end = first + count;
    while (first < end) {
      SceneFile& file = **std::ranges::upper_bound(scene_files_, first, {},
                                                   [](const auto& f) { return f->end_triangle; });
      const uint64_t n = std::min(end, file.end_triangle) - first;
      body(file, first - file.first_triangle, n);
      first += n;
    }
  }

  // The reader of one file is open at a time.
  gltf::TriangleReader& reader_of(SceneFile& file) {
    if (open_ != &file) {
      open_ = nullptr;
      reader_.reset();
      buffers_.emplace(files_, *file.file, file.document, file.external_files, file.decoded,
                       budget_, options_.readers);
      reader_.emplace(file.document, *buffers_, options_, budget_, cancel_);
      open_ = &file;
    }
    return *reader_;
  }

  FileSystem& files_;
  const std::span<const std::unique_ptr<SceneFile>> scene_files_;
  const gltf::ReaderOptions options_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  const SceneFile* open_ = nullptr;
  std::optional<gltf::BufferReader> buffers_;
  std::optional<gltf::TriangleReader> reader_;
};

class GltfScene : public TriangleSource {
 public:
  GltfScene(FileSystem& files, const std::vector<std::string>& paths, const SceneOptions& options,
            MemoryBudget& budget, const CancelToken& cancel)
      : file_system_(files), options_(options), budget_(budget), cancel_(cancel) {
    uint128 total = 0;
    for (const std::string& path : paths) {
      cancel.check();
      files_.push_back(std::make_unique<SceneFile>(files, path, options, budget, cancel));
      files_.back()->first_triangle = static_cast<uint64_t>(total);
      total += count_triangles(files_.back()->document, budget);
      if (total > INT64_MAX)
        throw Error(ErrorCode::kLimit, path + ": over 2^63 triangles, instances counted");
      files_.back()->end_triangle = static_cast<uint64_t>(total);
      files_.back()->first_material = material_count_;
      material_count_ += static_cast<uint32_t>(files_.back()->document.looks->materials.size());
    }
    declared_ = static_cast<uint64_t>(total);
  }

  std::unique_ptr<TriangleCursor> open(unsigned cursors) override {
    return std::make_unique<GltfCursor>(file_system_, files_,
                                        gltf::ReaderOptions{options_.skip_invalid, cursors},
                                        budget_, cancel_);
  }
  uint64_t declared_triangles() const override { return declared_; }
  SceneMaterials materials() const override {
    SceneMaterials all;
    all.materials.clear();
    for (const auto& f : files_) add_materials(all, materials_of(*f));
    return all;
  }
  uint32_t material_count() const override { return material_count_; }
  std::vector<SourceFile> files() const override {
    std::vector<SourceFile> all;
    for (const auto& f : files_) all.push_back({f->file->path(), f->file->identity()});
    for (const auto& f : files_)
      for (const SourceFile& file : f->external_files.all()) all.push_back(file);
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
  SceneMaterials materials_of(const SceneFile& f) const {
    const gltf::Looks& looks = *f.document.looks;
    SceneMaterials out{looks.materials, {}, looks.warnings, {}};
    for (const Material& material : looks.materials)  // those that the file lists come first
      if (material.number == out.names.size()) out.names.push_back(material.name);
    for (int image : looks.images)
      out.images.push_back(gltf::find_image(file_system_, *f.file, f.document, image));
    return out;
  }

  FileSystem& file_system_;
  const SceneOptions options_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  std::vector<std::unique_ptr<SceneFile>> files_;
  uint64_t declared_ = 0;
  uint32_t material_count_ = 0;
};

}  // namespace

void TriangleCursor::read_snapped(uint64_t first, uint64_t count, const Grid& grid,
                                  const Visitor& visit) {
  std::vector<SnappedTriangle> snapped;
  read(first, count, [&](std::span<const WorldTriangle> batch) {
    snapped.assign(batch.begin(), batch.end());
    for (SnappedTriangle& triangle : snapped)
      for (auto& vertex : triangle.v) snap_vertices(grid, vertex);
    visit(snapped);
  });
}

void TriangleCursor::read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit) {
  std::vector<SurfaceTriangle> surfaces;
  read(first, count, [&](std::span<const WorldTriangle> batch) {
    surfaces.assign(batch.size(), SurfaceTriangle{});
    for (size_t i = 0; i < batch.size(); ++i) surfaces[i].position = batch[i];
    visit(surfaces);
  });
}

WorldBounds TriangleCursor::read_bounds(uint64_t first, uint64_t count) {
  WorldBounds bounds;
  read(first, count, [&](std::span<const WorldTriangle> batch) { bounds.add(bounds_of(batch)); });
  return bounds;
}

// Files of one format that follow each other are one part.
std::unique_ptr<TriangleSource> open_scene(FileSystem& files, const std::vector<std::string>& paths,
                                           const SceneOptions& options, MemoryBudget& budget,
                                           const CancelToken& cancel) {
  std::vector<std::unique_ptr<TriangleSource>> parts;
  std::vector<std::string> gltf_paths;
  const auto add_gltf = [&] {
    if (gltf_paths.empty()) return;
    parts.push_back(std::make_unique<GltfScene>(files, gltf_paths, options, budget, cancel));
    gltf_paths.clear();
  };
  for (const std::string& path : paths) {
    cancel.check();
    std::unique_ptr<ReadableFile> file = files.open_read(path);
    if (!ply::is_ply(*file)) {
      gltf_paths.push_back(path);
      continue;
    }
    add_gltf();
    parts.push_back(ply::open_ply(std::move(file), options, budget, cancel));
  }
  add_gltf();
  return chain_scenes(std::move(parts));
}

}  // namespace voxdag
