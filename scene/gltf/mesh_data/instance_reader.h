// Reads the transforms of a node's instances (EXT_mesh_gpu_instancing), in windows of consecutive
// instances. A node without the extension has one identity transform. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "scene/gltf/mesh_data/accessor_reader.h"

namespace voxdag::gltf {

class InstanceReader {
 public:
  InstanceReader(const Document& document, BufferReader& buffers, const Node& node);

  uint64_t count() const { return count_; }
  // Returns the transform of an instance relative to the node: it scales first, then rotates, then
  // translates. Reads a window of instances if the last window does not contain this instance. So
  // calls in the order of the instances are fast.
  Transform at(uint64_t instance);

 private:
  void read_window(uint64_t first);

  std::optional<AccessorReader> translation_;
  std::optional<AccessorReader> rotation_;
  std::optional<AccessorReader> scale_;
  const bool present_;
  const uint64_t count_;
  uint64_t first_ = 0;
  std::vector<Transform> window_;
};

}  // namespace voxdag::gltf
