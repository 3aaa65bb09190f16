// The JSON that describes an unfinished job to viewers (docs/api.md).
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "core/io/file_system.h"
#include "server/jobs/protocol/job_folder.h"
#include "server/tiles/manifest.h"
#include "server/tiles/partial/coarse_cubes.h"

namespace voxdag::server {

// Returns the built subvolumes as JSON, each with its coarse brick.
std::string describe_cubes(const CoarseCubes& cubes, uint64_t resolution);

// Returns the manifest members that the plan determines: the position of the grid, the bounding box
// of the planned subvolumes, and a camera that sees all of them. Throws Error: kNotFound before the
// plan exists, kCorrupt if the plan is damaged.
nlohmann::ordered_json read_frame(FileSystem& files, const JobFolder& folder, uint64_t resolution);

}  // namespace voxdag::server
