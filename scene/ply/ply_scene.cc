#include "scene/ply/ply_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>

#include "core/base/page_buffer.h"
#include "scene/messages.h"
#include "scene/ply/face_reader.h"
#include "scene/ply/ply_file.h"
#include "scene/ply/vertex_colors.h"
#include "scene/ply/vertex_reader.h"
#include "scene/vertices/used_vertices.h"
#include "scene/vertices/vertex_cache.h"

namespace voxdag::ply {
namespace {

constexpr size_t kBatchTriangles = 1024;
// Triangles per window when bounds are computed. A vertex that several triangles of a window share
// is read once, if the window's vertex indices are close together.
constexpr size_t kWindowTriangles = 4096;

class PlyCursor : public TriangleCursor {
 public:
  PlyCursor(const PlyFile& ply, const SceneOptions& options, unsigned cursors, MemoryBudget& budget,
            const CancelToken& cancel)
      : ply_(ply),
        skip_invalid_(options.skip_invalid),
        cursors_(cursors),
        budget_(budget),
        cancel_(cancel),
        faces_(ply, budget),
        vertices_(ply, ply.axes(), budget),
        cache_(budget, vertices_.count(), cursors),
        corners_(3 * kWindowTriangles),
        batch_(budget, kBatchTriangles, "a batch of triangles") {
    cache_.bind(vertices_);
  }

  void read(uint64_t first, uint64_t count, const Visitor& visit) override {
    read_placed(first, count, nullptr, batch_, visit);
  }
  void read_snapped(uint64_t first, uint64_t count, const Grid& grid,
                    const Visitor& visit) override {
    read_placed(first, count, &grid, batch_, visit);
  }
  void read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit) override {
    if (ply_.colors().empty()) return TriangleCursor::read_surfaces(first, count, visit);
    if (!colors_) {
      surfaces_ = PageBuffer<SurfaceTriangle>(budget_, kBatchTriangles, "a batch of triangles");
      colors_.emplace(ply_, cursors_, budget_);
    }
    read_placed(first, count, nullptr, surfaces_, visit);
  }
  WorldBounds read_bounds(uint64_t first, uint64_t count) override {
    WorldBounds bounds;
    cache_.place(Transform{}, nullptr);
    for (const uint64_t end = first + count; first < end;) {
      cancel_.check();
      const uint64_t n = std::min<uint64_t>(end - first, kWindowTriangles);
      faces_.read(first, n, corners_.data());
      used_vertices_.find({corners_.data(), 3 * static_cast<size_t>(n)});
      if (!used_vertices_.add_to(bounds, cache_, vertices_.count()))
        bounds.add(TriangleCursor::read_bounds(first, n));
      first += n;
    }
    return bounds;
  }

 private:
  // Visits triangles [first, first + count) in batches, with vertices snapped to `grid` if it is
  // not null. T is RealTriangle or SurfaceTriangle.
  template <class T, class VisitBatch>
  void read_placed(uint64_t first, uint64_t count, const Grid* grid, PageBuffer<T>& batch,
                   const VisitBatch& visit) {
    cache_.place(Transform{}, grid);
    for (const uint64_t end = first + count; first < end;) {
      cancel_.check();
      const uint64_t n = std::min<uint64_t>(end - first, kBatchTriangles);
      faces_.read(first, n, corners_.data());
      size_t placed = 0;
      for (uint64_t i = 0; i < n; ++i) {
        const uint32_t* const corners = &corners_[3 * static_cast<size_t>(i)];
        if (place(corners, batch[placed]))
          ++placed;
        else if (!skip_invalid_)
          report(first + i, corners);
      }
      if (placed > 0) visit({batch.data(), placed});
      first += n;
    }
  }

  bool place(const uint32_t* corners, SurfaceTriangle& out) {
    if (!place(corners, out.position)) return false;
    out.material = 0;
    for (size_t k = 0; k < 3; ++k) out.corners[k] = {{}, colors_->at(corners[k])};
    return true;
  }

  // Returns false for a corner out of range or a vertex that is not finite.
  bool place(const uint32_t* corners, RealTriangle& out) {
    if (std::max({corners[0], corners[1], corners[2]}) >= vertices_.count()) return false;
    for (int k = 0; k < 3; ++k) std::copy_n(cache_.at(corners[k]), 3, out.v[k]);
    // If a vertex is not finite, all its coordinates are NaN.
    return cache_.all_finite() ||
           !(std::isnan(out.v[0][0]) || std::isnan(out.v[1][0]) || std::isnan(out.v[2][0]));
  }

  [[noreturn]] void report(uint64_t triangle, const uint32_t* corners) {
    const std::string where = "face " + std::to_string(faces_.face_of(triangle)) + ": ";
    const std::string& path = ply_.file().path();
    for (int k = 0; k < 3; ++k)
      if (corners[k] >= vertices_.count())
        refuse(path, where +
                         (corners[k] == UINT32_MAX ? "an index that is negative or too large"
                                                   : "index " + std::to_string(corners[k])) +
                         ", there are " + std::to_string(vertices_.count()) + " vertices");
    for (int k = 0; k < 3; ++k)
      if (std::isnan(cache_.at(corners[k])[0]))
        refuse(path, where + "vertex " + std::to_string(corners[k]) + " is not a finite position");
    refuse(path, where + "is invalid");
  }

  const PlyFile& ply_;
  const bool skip_invalid_;
  const unsigned cursors_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  FaceReader faces_;
  VertexReader vertices_;
  VertexCache cache_;
  std::vector<uint32_t> corners_;
  UsedVertices used_vertices_;
  PageBuffer<RealTriangle> batch_;
  // Allocated by the first read_surfaces().
  PageBuffer<SurfaceTriangle> surfaces_;
  std::optional<VertexColors> colors_;
};

// The cursor of a file without faces.
class NoTriangles : public TriangleCursor {
 public:
  void read(uint64_t, uint64_t, const Visitor&) override {}
};

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
    return std::make_unique<PlyCursor>(ply_, options_, cursors, budget_, cancel_);
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
