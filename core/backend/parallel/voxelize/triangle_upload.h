// Copies triangles from the stream into a space, through a staging area of the host. On a GPU there
// are two areas: one is filled while the other is copied. On the host the staging area is the
// destination itself.
#pragma once

#include <cstdint>

#include "core/backend/backend.h"

namespace voxdag::parallel {

// Copies up to `max_count` of the next triangles to `out`, in the space; returns their number, 0 at
// the end of the stream.
template <class Space>
uint32_t upload_triangles(Space& space, TriangleStream& stream, FixedTriangle* out,
                          uint32_t max_count) {
  uint32_t count = 0;
  while (count < max_count) {
    const std::span<FixedTriangle> area = space.staging(out + count, max_count - count);
    const size_t got = stream.read(area);
    if (got == 0) break;
    space.upload_staged(area.first(got), out + count);
    count += static_cast<uint32_t>(got);
  }
  return count;
}

}  // namespace voxdag::parallel
