// The contract of all backends. A backend makes the sub-DAG of one subvolume from its triangles.
//
//   1. The task's rule (core/geometry/voxel_rule.h) decides which voxels are set. Triangles that
//      miss the subvolume's cube have no effect.
//        shell  A voxel is set iff triangle_touches_cube() (core/geometry/overlap.h) holds for the
//               voxel's closed cube and at least one triangle.
//        thin   A voxel is set iff a triangle crosses, within the voxel, one of the three rows
//               through its center (core/geometry/crossing.h).
//   2. The sub-DAG is unique: no two nodes are equal, and level arrays are in the total order
//      (core/dag/level_array.h). The sub-DAG does not depend on the order of the triangles, the
//      size of the budget, the backend's method, or its caches.
//   3. All large buffers are charged to the given budget. If the budget cannot hold the subvolume,
//      build() returns kNeedsSplit without calling the sink, and the caller splits the cube and
//      tries again. A cube with an edge of kSmallestEdge never needs more than kSmallestBudget.
//   4. One thread uses a backend for many subvolumes. The backend may keep caches between builds.
//
// tests/conformance tests every backend.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/base/memory_budget.h"
#include "core/dag/sub_dag.h"
#include "core/geometry/cube.h"
#include "core/geometry/fixed_triangle.h"
#include "core/geometry/solid_rule.h"
#include "core/geometry/voxel_rule.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Edge of the smallest subvolumes, in voxels. The scheduler does not split these subvolumes.
inline constexpr int64_t kSmallestEdge = 64;
// Budget, in bytes, that is enough to build a subvolume with an edge of kSmallestEdge, for any
// number of triangles.
inline constexpr uint64_t kSmallestBudget = uint64_t{8} << 20;

// Supplies the triangles that may touch a subvolume, in no particular order. After rewind(), they
// can be read again.
class TriangleStream {
 public:
  virtual ~TriangleStream() = default;
  virtual uint64_t count() const = 0;
  // Restarts the stream at the first triangle.
  virtual void rewind() = 0;
  // Fills the front of `out`; returns the number of triangles read, 0 at the end.
  virtual size_t read(std::span<FixedTriangle> out) = 0;
};

// The task to build one subvolume. Its triangles come separately, from a TriangleStream.
struct SubvolumeTask {
  uint32_t grid_levels = 2;  // L: the grid has 2^L voxels per edge
  Cube cube;                 // its level is at most L-2
  uint32_t hash_bits = 64;   // 4 to 64
  // If not null, build() also fills the interior of the solid (core/geometry/solid_rule.h). `solid`
  // then has the solid's rule, and for each sample row its view (solid_rule.h) at the cube's low
  // face. Only the CPU backend fills solids.
  const SolidEntry* solid = nullptr;
  VoxelRule rule = VoxelRule::kShell;  // must be kShell if `solid` is set

  SubDagShape shape() const { return {cube.level, grid_levels, hash_bits}; }
};

enum class BuildOutcome {
  kBuilt,
  kNeedsSplit,  // the budget, or the device's memory, cannot hold the subvolume
};

class Backend {
 public:
  virtual ~Backend() = default;
  virtual std::string_view name() const = 0;
  // Builds one subvolume: passes its level arrays to `sink` and sets `summary`. Throws
  // Error{kCanceled}, Error{kDevice}, Error{kOutOfMemory}, and the errors of the stream and the
  // sink. After an error the backend remains usable.
  virtual BuildOutcome build(const SubvolumeTask& task, TriangleStream& triangles,
                             MemoryBudget& budget, const CancelToken& cancel, SubDagSink& sink,
                             SubDagSummary& summary) = 0;
};

// Instruction sets that the CPU backend has kernels for; each includes the previous one.
enum class Simd { kNone, kAvx2, kAvx512 };

// True if this machine and this build can run the kernels for an instruction set.
bool cpu_supports(Simd simd);

// Creates the CPU backend, which rasterizes bricks tile by tile and finds equal nodes in hash
// tables (core/dag/consing). It uses the largest instruction set up to `max_simd` that the machine
// supports, chosen at run time. The result is the same with every instruction set.
std::unique_ptr<Backend> make_cpu_backend(Simd max_simd = Simd::kAvx512);

// The algorithms of the parallel backends. All methods produce the same result. kPointers and
// kHashes are the two algorithms of Sintorn, "DAG Construction" (Eurographics 2018 tutorial).
enum class Method {
  kFast,      // bricks drawn tile by tile, DAG by hashes: the fastest on a GPU
  kPointers,  // voxel list, DAG by pointers
  kHashes,    // voxel list, DAG by hashes
};

// Creates a backend that runs the parallel pipeline (core/backend/parallel) on `threads` threads of
// the host, for tests and comparisons. If `threads` is 0, uses one thread for each hardware thread.
std::unique_ptr<Backend> make_parallel_host_backend(Method method, unsigned threads = 1);

// Returns the number of GPUs that make_cuda_backend() can open. Returns 0 if this build has no
// CUDA, or if the machine has no driver or device. Never throws.
int cuda_device_count();
inline bool cuda_device_available() { return cuda_device_count() > 0; }
// Returns the reason why no device is usable, as a message; "" if a device is usable.
std::string cuda_device_problem();

// Creates a backend that runs the parallel pipeline on the GPU with the number `device`, which must
// be below cuda_device_count(). Device memory is charged to the build's budget like host memory.
// Each backend has its own stream. So if two backends share a device, transfers and host work of
// one backend overlap with kernels of the other backend. Throws Error{kDevice} if the device does
// not exist or cannot be opened.
std::unique_ptr<Backend> make_cuda_backend(Method method = Method::kFast, int device = 0);

}  // namespace voxdag
