// The triangles of a scene on the coarser grid of a pilot. Triangles that become equal and are
// close in the scene's order are kept once. If the scene's triangles are much smaller than the
// pilot's voxels, few remain, and they have the same voxels.
#pragma once

#include <cstdint>
#include <memory>

#include "scheduler/spec/build_spec.h"
#include "scheduler/triangles/chunk.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

class PilotTriangles {
 public:
  // Triangles of the store's scene bin, coordinates divided by 2^shift, read by all threads as the
  // stage "estimate". If they take more than `budget` has, is_complete() is false.
  PilotTriangles(const TriangleStore& scene, uint32_t shift, MemoryBudget& budget,
                 const StageContext& context);

  bool is_complete() const { return is_complete_; }
  // On a grid that is 2^shift times coarser again. This must outlive the stream.
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
