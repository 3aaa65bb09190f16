#include "scene/chained_scene.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <utility>

#include "core/base/error.h"

namespace voxdag {
namespace {

struct Part {
  std::unique_ptr<TriangleSource> source;
  uint64_t first_triangle, end_triangle;
  uint32_t first_material;
};

// Appends the materials `more` of another scene to `all`. Increases their Material::image by the
// number of images in `all`, and their Material::number by the number of names in `all`.
void add_materials(SceneMaterials& all, SceneMaterials more) {
  for (Material& material : more.materials) {
    if (material.image != Material::kNoImage)
      material.image += static_cast<uint32_t>(all.images.size());
    if (material.number != Material::kNoNumber)
      material.number += static_cast<uint32_t>(all.names.size());
    all.materials.push_back(std::move(material));
  }
  std::ranges::move(more.images, std::back_inserter(all.images));
  std::ranges::move(more.names, std::back_inserter(all.names));
  all.warnings.add(more.warnings.list());
}

// Returns a visitor that adds `first_material` to the material index of each triangle, and passes
// the triangles to `visit`. `visit` must outlive the returned visitor.
TriangleCursor::SurfaceVisitor with_material_offset(uint32_t first_material,
                                                    const TriangleCursor::SurfaceVisitor& visit) {
  if (first_material == 0) return std::cref(visit);
  return [first_material, &visit,
          own = std::vector<SurfaceTriangle>()](std::span<const SurfaceTriangle> batch) mutable {
    own.assign(batch.begin(), batch.end());
    for (SurfaceTriangle& triangle : own) triangle.material += first_material;
    visit(own);
  };
}

// Reads the triangles of the parts (the joined scenes) one part after another. Only the current
// part's cursor is open, so it can use all memory of the ChainedCursor.
class ChainedCursor : public TriangleCursor {
 public:
  ChainedCursor(const std::vector<Part>& parts, unsigned cursors)
      : parts_(parts), cursors_(cursors) {}

  void read(uint64_t first, uint64_t count, const Visitor& visit) override {
    for_each_part(first, count, [&](TriangleCursor& cursor, uint64_t begin, uint64_t n) {
      cursor.read(begin, n, visit);
    });
  }
  void read_snapped(uint64_t first, uint64_t count, const Grid& grid,
                    const Visitor& visit) override {
    for_each_part(first, count, [&](TriangleCursor& cursor, uint64_t begin, uint64_t n) {
      cursor.read_snapped(begin, n, grid, visit);
    });
  }
  void read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit) override {
    for_each_part(first, count, [&](TriangleCursor& cursor, uint64_t begin, uint64_t n) {
      cursor.read_surfaces(begin, n, with_material_offset(open_->first_material, visit));
    });
  }
  WorldBounds read_bounds(uint64_t first, uint64_t count) override {
    WorldBounds bounds;
    for_each_part(first, count, [&](TriangleCursor& cursor, uint64_t begin, uint64_t n) {
      bounds.add(cursor.read_bounds(begin, n));
    });
    return bounds;
  }

 private:
  template <class Body>
  void for_each_part(uint64_t first, uint64_t count, const Body& body) {
    const uint64_t end = first + count;
    while (first < end) {
      const Part& part = *std::ranges::upper_bound(parts_, first, {}, &Part::end_triangle);
      if (open_ != &part) {
        open_ = nullptr;
        cursor_.reset();
        cursor_ = part.source->open(cursors_);
        open_ = &part;
      }
      const uint64_t n = std::min(end, part.end_triangle) - first;
      body(*cursor_, first - part.first_triangle, n);
      first += n;
    }
  }

  const std::vector<Part>& parts_;
  const unsigned cursors_;
  const Part* open_ = nullptr;
  std::unique_ptr<TriangleCursor> cursor_;
};

class ChainedScene : public TriangleSource {
 public:
  ChainedScene(std::vector<std::unique_ptr<TriangleSource>> sources, std::vector<Warning> warnings)
      : warnings_(std::move(warnings)) {
    for (auto& source : sources) {
      const uint64_t first = declared_triangles(), count = source->declared_triangles();
      if (count > INT64_MAX - first)
        throw Error(ErrorCode::kLimit,
                    "the files of the scene have over 2^63 triangles together, including "
                    "instances: expected fewer");
      const uint32_t materials = source->material_count();
      parts_.push_back({std::move(source), first, first + count, material_count_});
      material_count_ += materials;
    }
  }

  std::unique_ptr<TriangleCursor> open(unsigned cursors) override {
    return std::make_unique<ChainedCursor>(parts_, cursors);
  }
  uint64_t declared_triangles() const override {
    return parts_.empty() ? 0 : parts_.back().end_triangle;
  }
  SceneMaterials materials() const override {
    SceneMaterials all;
    all.materials.clear();
    for (const Part& part : parts_) add_materials(all, part.source->materials());
    return all;
  }
  uint32_t material_count() const override { return material_count_; }
  std::vector<SourceFile> files() const override {
    return all_of<SourceFile>([](const TriangleSource& source) { return source.files(); });
  }
  std::vector<Warning> warnings() const override {
    WarningList all;
    for (const Part& part : parts_) all.add(part.source->warnings());
    all.add(warnings_);
    return all.list();
  }

 private:
  template <class T, class List>
  std::vector<T> all_of(const List& list) const {
    std::vector<T> all;
    for (const Part& part : parts_)
      for (T& item : list(*part.source)) all.push_back(std::move(item));
    return all;
  }

  std::vector<Part> parts_;
  const std::vector<Warning> warnings_;
  uint32_t material_count_ = 0;
};

}  // namespace

std::unique_ptr<TriangleSource> chain_scenes(std::vector<std::unique_ptr<TriangleSource>> parts,
                                             std::vector<Warning> warnings) {
  if (parts.size() == 1 && warnings.empty()) return std::move(parts.front());
  return std::make_unique<ChainedScene>(std::move(parts), std::move(warnings));
}

}  // namespace voxdag
