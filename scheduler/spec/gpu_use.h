// The choice between the CPU and the GPUs of this machine, before the subvolumes are planned.
#pragma once

#include "core/backend/backend.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {

// Workers per GPU: enough to overlap transfers and host work of some workers with kernels of
// others.
inline constexpr unsigned kWorkersPerGpu = 4;

// True if `gpus` GPUs probably build subvolumes faster than `threads` threads of the CPU. `bricks`:
// total weight of the subvolumes (SubvolumePlan).
bool are_gpus_faster(double bricks, unsigned threads, int gpus);

// Returns the number of GPUs that these options use for subvolumes with a total weight of `bricks`;
// 0 if the CPU builds them. The options have passed check_backend(), and memory_bytes is set.
int gpus_to_use(const RunOptions& options, VoxelRule rule, double bricks);

}  // namespace voxdag
