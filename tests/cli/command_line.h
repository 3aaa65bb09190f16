// A test fixture that runs the built program and records its output.
#pragma once

#include <gtest/gtest.h>
#include <sys/types.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace command_line {

using Json = nlohmann::json;

struct Answer {
  int status = 0;   // exit status; 128 + signal if it was killed
  std::string out;  // standard output
  std::string err;  // standard error
};

class CommandLine : public testing::Test {
 protected:
  // Runs `voxdag ARGS...` within folder_.
  Answer run(const std::vector<std::string>& args);
  // Starts `voxdag ARGS...` without waiting; wait_for() returns its output.
  // Standard output is `output`, or a file if `output` is -1.
  pid_t start(const std::vector<std::string>& args, int output = -1);
  Answer wait_for(pid_t pid);
  // Runs `voxdag`, expects success, and parses standard output, which must be JSON and nothing
  // else.
  Json run_json(std::vector<std::string> args);
  // Runs `voxdag`, expects this exit status and a single message that contains `part`. The message
  // must recommend only options that the command has.
  void expect_error(int status, const std::string& part, const std::vector<std::string>& args);

  // Writes a Menger sponge of 2112 triangles to m.glb.
  void make_scene();

  // Expects that the command has all options that the message names, except for options in `args`.
  // A message names an option of another command as "voxdag COMMAND --x" or "--x of voxdag
  // COMMAND".
  void expect_own_options(const std::string& message, const std::vector<std::string>& args);

  bool exists(const std::string& name) const;
  std::string contents(const std::string& name) const;
  void put(const std::string& name, const std::string& bytes) const;

  voxdag::TemporaryFolder folder_;
};

}  // namespace command_line
