#pragma once

#include <array>

#include "core/backend/backend.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Calls visit(triangle) for the triangles from the stream's position to its end. Throws
// Error{kCanceled} after a cancellation.
template <class Visit>
void for_each_triangle(TriangleStream& stream, const CancelToken& cancel, const Visit& visit) {
  std::array<FixedTriangle, 256> batch;
  while (const size_t count = stream.read(batch)) {
    cancel.check();
    for (size_t i = 0; i < count; ++i) visit(batch[i]);
  }
}

}  // namespace voxdag
