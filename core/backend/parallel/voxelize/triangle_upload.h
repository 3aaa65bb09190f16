// Triangles from the stream into a space: read into a staging area of the host, copied from there.
// On a GPU two areas take turns, so that one is read into while the other is on its way; on the
// host the staging area is the destination itself.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/backend/backend.h"

namespace voxdag::parallel {

template <class Space>
class TriangleUpload {
 public:
  TriangleUpload(Space& space, TriangleStream& stream) : space_(space), stream_(stream) {
    stream_.rewind();
  }

  // Puts up to `most` triangles at `out`, in the space; returns how many, 0 at the stream's end.
  uint32_t read(FixedTriangle* out, uint32_t most) {
    uint32_t count = 0;
    while (count < most) {
      const std::span<FixedTriangle> area = space_.staging(out + count, most - count);
      const size_t got = stream_.read(area);
      if (got == 0) break;
      space_.upload_staged(area.first(got), out + count);
      count += static_cast<uint32_t>(got);
    }
    return count;
  }

 private:
  Space& space_;
  TriangleStream& stream_;
};

}  // namespace voxdag::parallel
