// A cube in binary files: its level and its position.
#pragma once

#include "core/format/bytes.h"
#include "core/geometry/cube.h"

namespace voxdag {

inline void put_cube(ByteSink& sink, const Cube& cube) {
  sink.put(cube.level);
  for (const uint32_t p : cube.position) sink.put(p);
}

inline Cube get_cube(ByteSource& source) {
  Cube cube;
  cube.level = source.get<uint32_t>();
  for (uint32_t& p : cube.position) p = source.get<uint32_t>();
  return cube;
}

}  // namespace voxdag
