// Checks a build's spec before the build starts.
#pragma once

#include <string>
#include <vector>

#include "scheduler/spec/build_spec.h"
#include "scheduler/state/build_scene.h"

namespace voxdag {

// Returns the spec with its defaults filled in. Throws Error{kInvalidInput} with the name of the
// invalid option, or Error{kDevice} for a backend whose device is missing.
BuildSpec checked(const BuildSpec& spec);

// If `spec` has a voxel size but no resolution, scans the scene for its extent, and returns `spec`
// with the smallest resolution whose grid contains the scene. Otherwise returns `spec` unchanged.
// Throws as checked() does.
BuildSpec with_resolution(const BuildSpec& spec, const BuildContext& context);

// Throws Error{kInvalidInput} if a file of the scene is one of `outputs` or a file of the work
// folder, because the build would overwrite or remove that file. Always checks the scene files that
// `spec` names. Also checks the files that these files name, such as buffers, in two cases:
// - The work folder has files but no job store, so no earlier build has checked the scene.
// - One of `outputs` begins with a zero byte, so it can be a file of voxdag or any other file.
void refuse_own_files(const BuildSpec& spec, BuildScene& scene, const std::string& work_folder,
                      std::vector<std::string> outputs, const BuildContext& context);

// Throws Error{kInvalidInput} if the output path is missing or names a folder, if the cache folder
// is the work folder, or if the build would overwrite a scene or a file not created by voxdag.
// Creates the output's parent folder and the cache folder.
void check_places(const BuildSpec& spec, BuildScene& scene, const BuildContext& context);

}  // namespace voxdag
