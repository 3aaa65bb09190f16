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

// True if the job has listed its planned subvolumes, has a work folder, and has not written its
// result. In the first seconds of a build, the work folder has no job store, because the build
// keeps the store in memory.
bool is_planned(FileSystem& files, const JobFolder& folder);
// Returns the number of planned subvolumes. Throws like read_frame().
uint64_t read_planned_total(FileSystem& files, const JobFolder& folder);

// Returns the manifest members that the plan determines: the position of the grid, the bounding box
// of the planned subvolumes, and a camera that sees all of them. Throws Error: kNotFound before the
// plan exists, kCorrupt if the plan is damaged.
nlohmann::ordered_json read_frame(FileSystem& files, const JobFolder& folder, uint64_t resolution);

}  // namespace voxdag::server
