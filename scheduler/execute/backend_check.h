// Whether a backend gives correct results on this machine: drivers and devices differ, and nobody
// would notice a wrong voxel.
#pragma once

#include <string>

#include "core/backend/backend.h"

namespace voxdag {

// Builds a few small subvolumes, with a thousand triangles of all sizes and several hash lengths,
// by `backend` and by the CPU backend. Returns "" if all level arrays and counts are equal, else a
// sentence. Throws what the backend throws. The CPU's part takes about 30 ms.
std::string difference_from_cpu(Backend& backend);

}  // namespace voxdag
