#include "scene/stl/stl_scene.h"

#include <algorithm>
#include <optional>
#include <span>
#include <utility>

#include "core/base/page_buffer.h"
#include "scene/messages.h"
#include "scene/stl/facet_colors.h"
#include "scene/stl/facets.h"
#include "scene/stl/stl_file.h"

namespace voxdag::stl {
namespace {

constexpr size_t kBatchFacets = 1024;

bool is_finite(const WorldTriangle& triangle) {
  return std::ranges::all_of(std::span(&triangle.v[0][0], 9), [](double c) { return c - c == 0; });
}

class StlCursor : public TriangleCursor {
 public:
  StlCursor(const StlFile& stl, bool skip_invalid, MemoryBudget& budget, const CancelToken& cancel)
      : stl_(stl),
        skip_invalid_(skip_invalid),
        budget_(budget),
        cancel_(cancel),
        facets_(open_facets(stl, budget)),
        batch_(budget, kBatchFacets, "a batch of triangles") {}

  void read(uint64_t first, uint64_t count, const Visitor& visit) override {
    for_each_batch(first, count, [&](std::span<RealTriangle> batch) { visit(batch); });
  }
  void read_snapped(uint64_t first, uint64_t count, const Grid& grid,
                    const Visitor& visit) override {
    for_each_batch(first, count, [&](std::span<RealTriangle> batch) {
      snap_vertices(grid, {&batch[0].v[0][0], 9 * batch.size()});
      visit(batch);
    });
  }
  void read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit) override {
    if (stl_.is_ascii()) return TriangleCursor::read_surfaces(first, count, visit);
    if (!colors_) {
      colors_.emplace(stl_.file());
      surfaces_ = PageBuffer<SurfaceTriangle>(budget_, kBatchFacets, "a batch of triangles");
    }
    for_each_batch(first, count, [&](std::span<RealTriangle> batch) {
      for (size_t i = 0; i < batch.size(); ++i) {
        surfaces_[i].position = batch[i];
        surfaces_[i].corners.fill({{}, colors_->color_of(attributes_[i])});
      }
      visit({surfaces_.data(), batch.size()});
    });
  }

 private:
  // Calls body(batch) for batches of triangles [first, first + count). Drops or refuses triangles
  // that are not finite, and sets attributes_.
  template <class Body>
  void for_each_batch(uint64_t first, uint64_t count, const Body& body) {
    for (const uint64_t end = first + count; first < end;) {
      cancel_.check();
      const auto n = static_cast<size_t>(std::min<uint64_t>(end - first, kBatchFacets));
      facets_->read(first, n, batch_.data());
      attributes_ = facets_->attributes();
      const size_t kept = keep_valid(first, n);
      if (kept > 0) body(std::span(batch_.data(), kept));
      first += n;
    }
  }

  size_t keep_valid(uint64_t first, size_t count) {
    size_t kept = 0;
    for (size_t i = 0; i < count; ++i) {
      if (!is_finite(batch_[i])) {
        if (!skip_invalid_)
          refuse(stl_.file().path(), facets_->place_of(first + i) + ": a vertex" + not_finite());
        continue;
      }
      if (kept < i) {
        batch_[kept] = batch_[i];
        if (!attributes_.empty()) attributes_[kept] = attributes_[i];
      }
      ++kept;
    }
    return kept;
  }

  const StlFile& stl_;
  const bool skip_invalid_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  const std::unique_ptr<Facets> facets_;
  PageBuffer<RealTriangle> batch_;
  std::vector<uint16_t> attributes_;  // attributes of the triangles in batch_
  // Allocated by the first read_surfaces().
  PageBuffer<SurfaceTriangle> surfaces_;
  std::optional<FacetColors> colors_;
};

class StlScene : public TriangleSource {
 public:
  StlScene(std::unique_ptr<ReadableFile> file, const SceneOptions& options, MemoryBudget& budget,
           const CancelToken& cancel)
      : stl_(std::move(file), budget, cancel),
        options_(options),
        budget_(budget),
        cancel_(cancel) {}

  std::unique_ptr<TriangleCursor> open(unsigned) override {
    return std::make_unique<StlCursor>(stl_, options_.skip_invalid, budget_, cancel_);
  }
  uint64_t declared_triangles() const override { return stl_.triangles(); }
  std::vector<SourceFile> files() const override {
    return {{stl_.file().path(), stl_.file().identity()}};
  }
  std::vector<Warning> warnings() const override { return stl_.warnings(); }

 private:
  const StlFile stl_;
  const SceneOptions options_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
};

}  // namespace

bool is_stl(const ReadableFile& file) { return format_of(file) != Format::kNone; }

std::unique_ptr<TriangleSource> open_stl(FileSystem&, std::unique_ptr<ReadableFile> file,
                                         const SceneOptions& options, MemoryBudget& budget,
                                         const CancelToken& cancel) {
  return std::make_unique<StlScene>(std::move(file), options, budget, cancel);
}

}  // namespace voxdag::stl
