// Checks of a build's spec before anything is read or written.
#pragma once

#include <span>
#include <string>

#include "scheduler/spec/build_spec.h"
#include "scheduler/state/build_scene.h"

namespace voxdag {

// A spec with its defaults filled in. Throws Error{kInvalidInput} naming the option that is wrong,
// Error{kDevice} for a backend whose device is missing.
BuildSpec checked(const BuildSpec& spec);

// Throws Error{kInvalidInput} if the scene reads one of `outputs` or a file of the work folder,
// which the build would overwrite or remove. Files that only the scene names, as its buffers, are
// looked up where no earlier build can have done so.
void refuse_own_files(const BuildSpec& spec, BuildScene& scene, const std::string& work_folder,
                      std::span<const std::string> outputs, const BuildContext& context);

// Throws Error{kInvalidInput} if the output could not be written at the end of the build, or if the
// build would overwrite a scene or a file that voxdag did not create.
void check_places(const BuildSpec& spec, BuildScene& scene, const BuildContext& context);

}  // namespace voxdag
