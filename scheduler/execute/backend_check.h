// Whether a backend can be believed on this machine: drivers and devices differ, and a wrong voxel
// would not be seen.
#pragma once

#include <string>

#include "core/backend/backend.h"

namespace voxdag {

// Builds a few small subvolumes, a thousand triangles of all sizes and every hash length, by
// `backend` and by the CPU backend. "" if all level arrays and counts are equal, else a sentence.
// Throws what the backend throws. The CPU's part takes about 30 ms.
std::string difference_from_cpu(Backend& backend);

}  // namespace voxdag
