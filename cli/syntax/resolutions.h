// Several resolutions in one command, such as `build -r 1k,2k,4k`: one build for each.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "scheduler/spec/build_spec.h"

namespace voxdag::cli {

// Parses the value of --resolution: one or several resolutions, separated by commas. Throws
// Error{kInvalidInput}.
std::vector<uint64_t> parse_resolutions(const std::string& text);
// Returns the documentation of the option.
std::string resolutions_help();

// Returns one build for each resolution, in the same order. If there are several, the names of a
// build's files and work folder contain the build's resolution: OUT.vdag becomes OUT-1024.vdag.
std::vector<BuildSpec> builds_of(const BuildSpec& spec, const std::vector<uint64_t>& resolutions);

}  // namespace voxdag::cli
