// This file is compiled for x86-64 CPUs with the instruction POPCNT, so its functions may run only
// after a check that the CPU has it.
#include "core/format/verify/node_batch.h"

namespace voxdag {
namespace {

struct WithPopcnt {};

void compute(const NodeLevel& level, NodeBatch& batch) {
  BatchComputer<WithPopcnt>(level, batch).run();
}

}  // namespace

ComputeBatch compute_batch_popcnt() { return __builtin_cpu_supports("popcnt") ? compute : nullptr; }

}  // namespace voxdag
