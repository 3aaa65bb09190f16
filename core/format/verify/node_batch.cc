#include "core/format/verify/node_batch.h"

namespace voxdag {
namespace {

struct Portable {};

}  // namespace

#ifndef __x86_64__
ComputeBatch compute_batch_popcnt() { return nullptr; }
#endif

void compute_batch_portable(const NodeLevel& level, NodeBatch& batch) {
  BatchComputer<Portable>(level, batch).run();
}

ComputeBatch compute_batch() {
  const ComputeBatch faster = compute_batch_popcnt();
  return faster ? faster : compute_batch_portable;
}

}  // namespace voxdag
