// A digest of the grid and of the snapped triangles in their order: tells whether a scene still has
// the content that a job was begun with. A plain value, so that a checkpoint can store it and a
// later run continue it.
#pragma once

#include <string>

#include "core/format/checksum.h"
#include "core/geometry/grid.h"

namespace voxdag {

class ContentDigest {
 public:
  ContentDigest() = default;
  explicit ContentDigest(const Grid& grid);
  // Adds the checksum of the next piece of the scene.
  void add(const Checksum128& piece);
  // 32 lower-case hex digits of what was added so far.
  std::string hex() const;

 private:
  Checksum128 state_;
};

}  // namespace voxdag
