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

// Reads the triangles of a scene for one thread. Any number of cursors may read concurrently.
class TriangleCursor {
 public:
  using Visitor = std::function<void(std::span<const RealTriangle>)>;

  using SurfaceVisitor = std::function<void(std::span<const SurfaceTriangle>)>;

  virtual ~TriangleCursor() = default;
  // Calls `visit` with batches of 1 to 1024 triangles, all finite, in the scene's order: the
  // declared triangles [first, first + count), without those that skip_invalid drops. Going back to
  // earlier triangles takes longer. Throws Error with scene file, node, mesh, primitive or
  // accessor.
  virtual void read(uint64_t first, uint64_t count, const Visitor& visit) = 0;
  // Like read(), but with each vertex snapped to `grid`.
  virtual void read_snapped(uint64_t first, uint64_t count, const Grid& grid, const Visitor& visit);
  // Visits the triangles with their surfaces. The default implementation makes all triangles white,
  // with material 0.
  virtual void read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit);
  // Returns the bounds of the triangles that read() visits.
  virtual WorldBounds read_bounds(uint64_t first, uint64_t count);
};

// A stored image of a scene: a PNG or JPEG file, or anything that claims to be one. Its source is
// the range [offset, offset + size) of the file. The image is `bytes` bytes of the source's
// (decoded) contents, starting at `skip`.
struct ImageSource {
  std::string name;  // name in messages: the image and its scene file
  SourceFile file;
  uint64_t offset = 0, size = 0;
  // The source has base64 characters, some of which may be escaped by JSON.
  bool is_base64 = false;
  bool is_data_uri = false;  // the base64 characters begin after the first comma
  uint64_t skip = 0;
  uint64_t bytes = UINT64_MAX;  // fewer if the source has fewer
  std::string problem;          // why the image cannot be read, if known; otherwise ""
};

struct SceneMaterials {
  std::vector<Material> materials = {Material{}};  // at least one
  std::vector<ImageSource> images;                 // images that materials use
  std::vector<std::string> warnings;               // only about materials and images
  std::vector<std::string> names;  // names of the materials listed in the scene's files, in order

  // Removes the images, so that materials have only their factors.
  void drop_images() {
    for (Material& material : materials) material.image = Material::kNoImage;
    images.clear();
  }
  // Appends the name "" to `names`, and gives its number to the materials without a number, which
  // are used by triangles without material.
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
  // Returns a cursor. `cursors` is the number of cursors that share the memory. The source must
  // outlive the cursor.
  virtual std::unique_ptr<TriangleCursor> open(unsigned cursors) = 0;
  // Calls `visit` with all triangles, in batches as in TriangleCursor::read().
  void for_each_batch(const Visitor& visit) { open(1)->read(0, declared_triangles(), visit); }
  // Number of triangles that the scene declares, including instances: visited triangles and
  // triangles that skip_invalid drops.
  virtual uint64_t declared_triangles() const = 0;
  // The materials that TriangleCursor::read_surfaces() refers to. Opens image files, but reads no
  // image. An image that cannot be opened is not an error.
  virtual SceneMaterials materials() const { return {}; }
  // Number of materials that materials() would return.
  virtual uint32_t material_count() const { return 1; }
  // All files that the triangles come from, with their identity when they were first opened. If a
  // file has a different identity when it is opened again, this is an error.
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
