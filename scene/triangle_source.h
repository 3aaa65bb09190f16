// The interface of a scene. A scene streams its triangles in world space, without having all of
// them in memory. The order of the triangles is always the same, for any number of threads.
// open_scene() in scene/formats/formats.h opens scene files; tests make their own scenes.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/warning.h"
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
  // Visits the declared triangles [first, first + count) in the scene's order, in batches of 1 to
  // 1024 triangles. An invalid triangle is dropped if SceneOptions::skip_invalid is set. Otherwise
  // read() throws an Error that names the scene file and the node, mesh, primitive, accessor or
  // face. So all visited vertices are finite. Increasing ranges are the fastest to read.
  virtual void read(uint64_t first, uint64_t count, const Visitor& visit) = 0;
  // Like read(), but the vertices are snapped to `grid`.
  virtual void read_snapped(uint64_t first, uint64_t count, const Grid& grid, const Visitor& visit);
  // Like read(), but each triangle has its material, texture coordinates and colors. The default
  // implementation makes all triangles white, with material 0.
  virtual void read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit);
  // Returns the bounds of the triangles that read() visits.
  virtual WorldBounds read_bounds(uint64_t first, uint64_t count);
};

// The place where an image of a scene is stored. open_scene() does not read the image, so the image
// may be damaged or of any format. The range [offset, offset + size) of `file` holds bytes, or
// characters that encode bytes in base64 or by percent-encoding. The first `skip` bytes, counted
// after decoding, do not belong to the image. The following `bytes` bytes are the image.
struct ImageSource {
  std::string name;  // name in messages: the image and its scene file
  SourceFile file;
  uint64_t offset = 0, size = 0;
  // If is_base64 or is_data_uri is true, the range holds characters that encode bytes. JSON may
  // have escaped some of these characters.
  bool is_base64 = false;
  bool is_data_uri = false;  // true: the characters follow the first comma of a data: URI
  uint64_t skip = 0;
  uint64_t bytes = UINT64_MAX;  // fewer if the range ends earlier
  std::string problem;          // why the image cannot be read, if known; otherwise ""
};

struct SceneMaterials {
  std::vector<Material> materials = {Material{}};  // at least one
  std::vector<ImageSource> images;                 // images that materials use
  WarningList warnings;                            // only about materials and images
  std::vector<std::string> names;  // names of the materials listed in the scene's files, in order

  // Removes the images, so that materials have only their factors.
  void drop_images() {
    for (Material& material : materials) material.image = Material::kNoImage;
    images.clear();
  }
  // Gives the next number, with the name "", to all materials without a number. These are the
  // materials of triangles for which the file gives no material.
  void name_unlisted() {
    for (Material& material : materials)
      if (material.number == Material::kNoNumber)
        material.number = static_cast<uint32_t>(names.size());
    names.emplace_back();
  }
};

// The members of SceneOptions that affect a scene. skip_invalid is not included, because only
// reading all triangles shows whether a scene has invalid triangles.
struct UsedOptions {
  bool point_radius = false, columns = false;
  std::vector<std::string> ignored_extensions;
};

class TriangleSource {
 public:
  using Visitor = TriangleCursor::Visitor;

  virtual ~TriangleSource() = default;
  // Returns a cursor. `cursors` is the number of open cursors that share the memory budget. The
  // source must outlive the cursor.
  virtual std::unique_ptr<TriangleCursor> open(unsigned cursors) = 0;
  // Calls `visit` with all triangles, in batches as in TriangleCursor::read().
  void for_each_batch(const Visitor& visit) { open(1)->read(0, declared_triangles(), visit); }
  // Returns the number of triangles that the scene declares. Each instance counts separately.
  // Triangles that skip_invalid drops are included.
  virtual uint64_t declared_triangles() const = 0;
  // Returns the materials that TriangleCursor::read_surfaces() refers to. Opens image files, but
  // reads no image. An image that cannot be opened is not an error.
  virtual SceneMaterials materials() const { return {}; }
  // Returns the number of materials that materials() would return.
  virtual uint32_t material_count() const { return 1; }
  // Returns all files that the triangles come from, with their identity when they were first
  // opened. Reading throws an Error if a file has another identity when it is opened again.
  virtual std::vector<SourceFile> files() const { return {}; }
  // Returns the members of SceneOptions that affect this scene.
  virtual UsedOptions used_options() const { return {}; }
  // Warnings about the files (ignored optional extensions, points and lines that make no voxels).
  virtual std::vector<Warning> warnings() const { return {}; }
};

struct SceneOptions {
  // Drop invalid triangles (vertices that are not finite, indices out of range) instead of refusing
  // the scene. declared_triangles() includes the dropped triangles, so callers can count them.
  bool skip_invalid = false;
  // Path of the temporary file for decompressed geometry, in an existing folder. The name is
  // removed as soon as the file is open. "": a path in a new folder in temporary_parent().
  std::string scratch_path = {};
  // Half edge of the cube that replaces each point, in the scene's units; 0: a point sets one
  // voxel.
  double point_radius = 0;
  // Names of the columns of text files with points, such as "x,y,z,_,r,g,b"; "": the first row
  // decides. scene/points/columns.h defines the names.
  std::string columns = {};
  // Names of required glTF extensions to ignore, although voxdag does not read them.
  std::vector<std::string> ignored_extensions = {};
};

}  // namespace voxdag
