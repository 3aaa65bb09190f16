// The triangles of a scene on the coarser grid of a pilot. Triangles that become equal on this grid
// are kept only once if they are close together in the scene's order. If the scene's triangles are
// much smaller than the pilot's voxels, few triangles remain. They touch the same voxels of the
// pilot's grid as all triangles. The rules of solids count every crossing of a triangle, so the
// pilots of solids keep equal triangles, except triangles without area, which cross nothing.
#pragma once

#include <cstdint>
#include <memory>

#include "scheduler/spec/build_spec.h"
#include "scheduler/triangles/chunk.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

class PilotTriangles {
 public:
  // Copies the triangles of the store's scene bin, with coordinates divided by 2^shift. All threads
  // of the stage "estimate" read the bin. If `keeps_equal` is true, equal triangles with an area
  // are kept. If `budget` is too small for the copy, is_complete() is false.
  PilotTriangles(const TriangleStore& scene, uint32_t shift, bool keeps_equal, MemoryBudget& budget,
                 const StageContext& context);

  bool is_complete() const { return is_complete_; }
  // Streams the triangles on a grid that is 2^shift times coarser than the grid of this object. The
  // object must outlive the stream.
  std::unique_ptr<TriangleStream> open(uint32_t shift) const;
  // CPU time of all threads.
  double cpu_s() const { return cpu_s_; }

 private:
  const size_t record_bytes_;
  ChunkList list_;
  MemoryCharge charge_;
  bool is_complete_ = true;
  double cpu_s_ = 0;
};

}  // namespace voxdag
