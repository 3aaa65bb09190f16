// The options that the commands `build`, `plan` and `submit` share.
#pragma once

#include <string>

#include "cli/command.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag::cli {

// Option values as text; spec() checks and converts them.
class BuildOptions {
 public:
  // Adds the scene, geometry and run options to a command.
  void declare(Command& command);
  // Adds --work to a command that builds on this machine.
  void declare_work_folder(Command& command);
  // Throws Error{kInvalidInput} that names the invalid option.
  BuildSpec spec() const;

 private:
  BuildSpec spec_;
  std::string bounds_;
  std::string attributes_;
  std::string memory_;
};

}  // namespace voxdag::cli
