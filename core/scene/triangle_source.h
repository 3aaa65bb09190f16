// Where triangles come from: a scene streams its triangles in world space, always in the same
// order, without holding them all. Scenes are glTF files (open_scene) or made by tests.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/base/memory_budget.h"
#include "core/geometry/grid.h"
#include "core/io/file_system.h"

namespace voxdag {

struct SourceFile {
  std::string path;
  FileIdentity identity;
  bool operator==(const SourceFile&) const = default;
};

class TriangleSource {
 public:
  using Visitor = std::function<void(std::span<const WorldTriangle>)>;

  virtual ~TriangleSource() = default;
  // Calls `visit` with batches of 1 to 4096 triangles, all finite, until none is left; may be
  // called again and gives the same triangles in the same order. Throws Error naming scene file,
  // node, mesh, primitive or accessor.
  void for_each_batch(const Visitor& visit) { for_each_batch_from(0, visit); }
  // The same, past the first `first` declared triangles: jumps over them without looking at them.
  virtual void for_each_batch_from(uint64_t first, const Visitor& visit) = 0;
  // Declared triangles up to the end of the batch that is visited: where another pass may begin.
  virtual uint64_t position() const = 0;
  // Triangles the scene declares, instances counted; what for_each_batch() gives plus what
  // skip_invalid drops.
  virtual uint64_t declared_triangles() const = 0;
  // Dropped by skip_invalid in the last pass.
  virtual uint64_t invalid_triangles() const = 0;
  // All files that the triangles come from, as they were when they were opened.
  virtual std::vector<SourceFile> files() const { return {}; }
  // What a user should know, one sentence each (ignored optional extensions, points and lines that
  // make no voxels).
  virtual std::vector<std::string> warnings() const { return {}; }
};

struct SceneOptions {
  // Drop and count invalid triangles (non-finite vertices, indices out of range) instead of
  // refusing the scene.
  bool skip_invalid = false;
};

// One scene made of several glTF 2.0 files (.glb, or .gltf with external or data-URI buffers),
// each one's default scene. Geometry is read by windows charged to `budget`; images never are.
// Structure is checked here; contents while streaming. `cancel` is looked at between batches.
std::unique_ptr<TriangleSource> open_scene(FileSystem& files, const std::vector<std::string>& paths,
                                           const SceneOptions& options, MemoryBudget& budget,
                                           const CancelToken& cancel);

}  // namespace voxdag
