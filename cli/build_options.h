// The options that `build`, `plan` and `submit` share: what to build, and within which limits.
#pragma once

#include <string>

#include "cli/command.h"
#include "scheduler/build_spec.h"

namespace voxdag::cli {

// Options as typed; spec() checks and translates them.
class BuildOptions {
 public:
  // Declares the scene, geometry and run options on a command.
  void declare(CLI::App& command);
  // And --work, for commands that build on this machine.
  void declare_work_folder(CLI::App& command);
  // Throws Error{kInvalidInput} naming the option that is wrong.
  BuildSpec spec() const;

 private:
  BuildSpec spec_;
  std::string bounds_;
  std::string memory_;
};

}  // namespace voxdag::cli
