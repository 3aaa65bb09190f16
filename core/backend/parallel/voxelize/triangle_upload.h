// Copies triangles from the stream into a space, through a staging area of the host. On a GPU there
// are two areas: one is filled while the other is copied. On the host the staging area is the
// destination itself.
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

  // Copies up to `max_count` triangles to `out`, in the space; returns their number, 0 at the end
  // of the stream.
  uint32_t read(FixedTriangle* out, uint32_t max_count) {
    uint32_t count = 0;
    while (count < max_count) {
      const std::span<FixedTriangle> area = space_.staging(out + count, max_count - count);
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
