// The scene of a build, opened and parsed once for the stages that read it one after another.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/base/memory_budget.h"
#include "scene/triangle_source.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {

// Returns the options that decide how the scene's files are read. Leaves scratch_path empty.
SceneOptions scene_options_of(const GeometryOptions& options);

class BuildScene {
 public:
  // Compressed geometry is decoded to a file in `scratch_folder`, which must exist before triangles
  // are read. The references must outlive this object.
  BuildScene(const GeometryOptions& options, const std::string& scratch_folder,
             MemoryBudget& budget, const BuildContext& context);

  // Opens the scene unless it is open.
  TriangleSource& open();
  // Unix time just before open() opened the scene.
  int64_t opened_ns() const { return opened_ns_; }
  // Frees the scene's memory and decoded geometry. The next open() parses it again.
  void close() { scene_.reset(); }

 private:
  const GeometryOptions& options_;
  const std::string scratch_path_;
  MemoryBudget& budget_;
  const BuildContext& context_;
  std::unique_ptr<TriangleSource> scene_;
  int64_t opened_ns_ = 0;
};

}  // namespace voxdag
