#include "scene/stl/facets.h"

#include <algorithm>

#include "scene/messages.h"
#include "scene/stl/facet.h"
#include "scene/stl/polygon_reader.h"
#include "scene/text/file_window.h"

namespace voxdag::stl {
namespace {

class BinaryFacets : public Facets {
 public:
  BinaryFacets(const StlFile& stl, MemoryBudget& budget) : window_(stl.file(), budget) {}

  void read(uint64_t first, size_t count, WorldTriangle* out) override {
    attributes_.clear();
    while (count > 0) {
      const size_t n = std::min<size_t>(count, FileWindow::kBytes / kFacetBytes);
      const auto bytes = window_.at(kHeaderBytes + first * kFacetBytes, n * kFacetBytes);
      for (size_t i = 0; i < n; ++i) {
        const Facet facet = load_facet(bytes.subspan(i * kFacetBytes));
        std::ranges::copy(facet.corners, &out[i].v[0][0]);
        attributes_.push_back(facet.attribute);
      }
      first += n;
      out += n;
      count -= n;
    }
  }
  std::string place_of(uint64_t triangle) override { return "facet " + std::to_string(triangle); }

 private:
  FileWindow window_;
};

class AsciiFacets : public Facets {
 public:
  AsciiFacets(const StlFile& stl, MemoryBudget& budget)
      : stl_(stl), polygons_(stl.file(), budget) {}

  void read(uint64_t first, size_t count, WorldTriangle* out) override {
    seek(first);
    for (const uint64_t end = first + count;;) {
      for (const uint64_t polygon_end = std::min(end, this->polygon_end()); first < polygon_end;
           ++first, ++out) {
        const auto triangle = static_cast<size_t>(first - first_triangle_);
        for (size_t k = 0; k < 3; ++k) std::ranges::copy(polygons_.vertex(triangle, k), out->v[k]);
      }
      if (first == end) return;
      load();
    }
  }
  std::string place_of(uint64_t triangle) override {
    seek(triangle);
    return "facet " + std::to_string(polygon_) + " in line " + std::to_string(polygons_.line());
  }

 private:
  // Reads the polygon that contains the triangle. Continues from the current polygon, unless the
  // triangle is in an earlier polygon or in a later block of recorded polygons (block_index.h). In
  // these cases, starts at the triangle's block.
  void seek(uint64_t triangle) {
    const bool is_ahead = is_loaded_ && triangle >= first_triangle_;
    if (is_ahead && triangle < polygon_end()) return;
    const auto& index = stl_.polygon_index();
    const uint64_t block = index.find(triangle, &StlFile::PolygonPlace::first_triangle);
    if (!is_ahead || polygon_ < block) {
      const StlFile::PolygonPlace& place = index.at(block);
      is_loaded_ = false;
      polygons_.seek(place.offset, place.line);
      read_polygon();
      polygon_ = block;
      first_triangle_ = place.first_triangle;
    }
    while (triangle >= polygon_end()) load();
  }

  void load() {
    const uint64_t next = polygon_end();
    read_polygon();
    ++polygon_;
    first_triangle_ = next;
  }

  void read_polygon() {
    is_loaded_ = false;
    if (!polygons_.next())
      refuse(stl_.file().path(), "changed while it was read: expected a file that does not change");
    is_loaded_ = true;
  }

  // Returns the number of the first triangle of the next polygon.
  uint64_t polygon_end() const { return first_triangle_ + polygons_.triangles(); }

  const StlFile& stl_;
  PolygonReader polygons_;
  // The current polygon and its first triangle. Valid only if is_loaded_ is true.
  bool is_loaded_ = false;
  uint64_t polygon_ = 0, first_triangle_ = 0;
};

}  // namespace

std::unique_ptr<Facets> open_facets(const StlFile& stl, MemoryBudget& budget) {
  if (stl.is_ascii()) return std::make_unique<AsciiFacets>(stl, budget);
  return std::make_unique<BinaryFacets>(stl, budget);
}

}  // namespace voxdag::stl
