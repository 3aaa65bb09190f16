// The interface of a scene: it streams its triangles in world space, always in the same order and
// for any number of threads, without having all of them in memory. open_scene() in
// scene/formats/formats.h opens scene files; tests make their own scenes.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/color/surface.h"
#include "core/geometry/grid.h"
#include "core/io/file_system.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

struct SourceFile {
  std::string path;
  FileIdentity identity;
  bool operator==(const SourceFile&) const = default;
};

// Reads the triangles of a scene for one thread; any number of cursors may read at the same time.
class TriangleCursor {
 public:
  using Visitor = std::function<void(std::span<const RealTriangle>)>;

  using SurfaceVisitor = std::function<void(std::span<const SurfaceTriangle>)>;

  virtual ~TriangleCursor() = default;
  // Calls `visit` with batches of 1 to 1024 triangles, all finite: those among the declared
  // triangles [first, first + count) that skip_invalid does not drop, in the scene's order. Going
  // back to earlier triangles takes longer. Throws Error naming scene file, node, mesh, primitive
  // or accessor.
  virtual void read(uint64_t first, uint64_t count, const Visitor& visit) = 0;
  // Does the same with each vertex snapped to `grid`.
  virtual void read_snapped(uint64_t first, uint64_t count, const Grid& grid, const Visitor& visit);
  // Visits the triangles with their surfaces. The default: white, material 0.
  virtual void read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit);
  // The bounds of the triangles that read() visits.
  virtual WorldBounds read_bounds(uint64_t first, uint64_t count);
};

// An image of a scene, as it is stored: a PNG or JPEG file, or anything that claims to be one. Its
// bytes are `bytes` of those that [offset, offset + size) of the file hold, from `skip` on.
struct ImageSource {
  std::string name;  // for messages: which image of which scene file
  SourceFile file;
  uint64_t offset = 0, size = 0;
  // The file has base64 characters there, of which JSON may have escaped some.
  bool is_base64 = false;
  bool is_data_uri = false;  // base64 that begins behind the first comma
  uint64_t skip = 0;
  uint64_t bytes = UINT64_MAX;  // fewer if there are fewer
  std::string problem;          // why it cannot be read, if that is known; "" otherwise
};

struct SceneMaterials {
  std::vector<Material> materials = {Material{}};  // at least one
  std::vector<ImageSource> images;                 // those that materials use
  std::vector<std::string> warnings;               // about materials and images only
  std::vector<std::string> names;  // of the materials that the scene's files list, in their order

  // Leaves the factors of materials alone.
  void drop_images() {
    for (Material& material : materials) material.image = Material::kNoImage;
    images.clear();
  }
  // Appends a name, "", for the triangles without material, and gives them its number.
  void name_unlisted() {
    for (Material& material : materials)
      if (material.number == Material::kNoNumber)
        material.number = static_cast<uint32_t>(names.size());
    names.emplace_back();
  }
};

class TriangleSource {
 public:
  using Visitor = TriangleCursor::Visitor;

  virtual ~TriangleSource() = default;
  // A cursor, one of `cursors` that share the memory. The source must outlive it.
  virtual std::unique_ptr<TriangleCursor> open(unsigned cursors) = 0;
  // Calls `visit` with all triangles, by batches as TriangleCursor::read() does.
  void for_each_batch(const Visitor& visit) { open(1)->read(0, declared_triangles(), visit); }
  // Number of triangles that the scene declares, instances included: visited triangles and
  // triangles that skip_invalid drops.
  virtual uint64_t declared_triangles() const = 0;
  // What TriangleCursor::read_surfaces() refers to. Opens image files, but reads no image; one that
  // cannot be opened is no error.
  virtual SceneMaterials materials() const { return {}; }
  // The number of those materials.
  virtual uint32_t material_count() const { return 1; }
  // All files that the triangles come from, with their identity when they were first opened. One
  // that turns out to be another when it is opened again is an error.
  virtual std::vector<SourceFile> files() const { return {}; }
  // Warnings for the user, one sentence each (ignored optional extensions, points and lines that
  // make no voxels).
  virtual std::vector<std::string> warnings() const { return {}; }
};

struct SceneOptions {
  // Drop and count invalid triangles (non-finite vertices, indices out of range) instead of
  // refusing the scene.
  bool skip_invalid = false;
  // File for decoded geometry, in an existing folder. The file has this name only for a moment. "":
  // in a new folder in temporary_parent().
  std::string scratch_path = {};
};

}  // namespace voxdag
