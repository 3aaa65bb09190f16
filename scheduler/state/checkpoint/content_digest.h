// A digest of the grid and of the snapped triangles, in the order of the scene. It detects scenes
// that changed since a job began. A plain value: a checkpoint stores the digest, and a later run
// adds the remaining pieces of the scene to it.
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
  // Returns the digest of the added data as 32 lower-case hex digits.
  std::string hex() const;

 private:
  Checksum128 state_;
};

}  // namespace voxdag
