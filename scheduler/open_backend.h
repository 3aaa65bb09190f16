// Which backend a build's workers open.
#pragma once

#include <functional>
#include <memory>

#include "core/backend/backend.h"
#include "scheduler/build_spec.h"

namespace voxdag {

// Opens one backend a call, one call a worker. Throws Error{kInvalidInput} for a name or method
// that does not exist or do not go together, Error{kDevice} if there is no GPU for `cuda`.
std::function<std::unique_ptr<Backend>()> backend_opener(const RunOptions& options);

}  // namespace voxdag
