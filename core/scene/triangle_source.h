// The interface of a scene: it streams its triangles in world space, always in the same order,
// without having all of them in memory. Scenes are glTF files (open_scene) or made by tests.
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
  // Calls `visit` with batches of 1 to 4096 triangles, all finite, until none is left. Every call
  // passes the same triangles in the same order. Throws Error naming scene file, node, mesh,
  // primitive or accessor.
  void for_each_batch(const Visitor& visit) { for_each_batch_from(0, visit); }
  // Calls `visit` like for_each_batch(), but skips the first `first` declared triangles without
  // reading them.
  virtual void for_each_batch_from(uint64_t first, const Visitor& visit) = 0;
  // The number of declared triangles up to the end of the batch that is being visited, from which
  // another pass may begin.
  virtual uint64_t position() const = 0;
  // The triangles that the scene declares, instances counted: those that for_each_batch() visits
  // and those that skip_invalid drops.
  virtual uint64_t declared_triangles() const = 0;
  // The triangles that skip_invalid dropped in the last pass.
  virtual uint64_t invalid_triangles() const = 0;
  // All files that the triangles come from, with their identity when they were opened.
  virtual std::vector<SourceFile> files() const { return {}; }
  // Warnings for the user, one sentence each (ignored optional extensions, points and lines that
  // make no voxels).
  virtual std::vector<std::string> warnings() const { return {}; }
};

struct SceneOptions {
  // Drop and count invalid triangles (non-finite vertices, indices out of range) instead of
  // refusing the scene.
  bool skip_invalid = false;
};

// One scene made of the default scenes of several glTF 2.0 files (.glb, or .gltf with external or
// data-URI buffers). Geometry is read by windows charged to `budget`; images are never read. The
// structure is checked here, contents while streaming; `cancel` is checked between batches. Throws
// Error{kInvalidInput}, {kNotFound}, {kLimit} or {kOutOfMemory} naming the file. The references
// must outlive the scene.
std::unique_ptr<TriangleSource> open_scene(FileSystem& files, const std::vector<std::string>& paths,
                                           const SceneOptions& options, MemoryBudget& budget,
                                           const CancelToken& cancel);

}  // namespace voxdag
