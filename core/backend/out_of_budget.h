// The exception by which a backend abandons a subvolume that does not fit.
#pragma once

namespace voxdag {

// The budget, or the device's memory, cannot hold the subvolume. Thrown and caught within a
// backend; Backend::build() then returns BuildOutcome::kNeedsSplit.
struct OutOfBudget {};

}  // namespace voxdag
