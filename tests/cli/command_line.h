// Runs the built program as a user does, and keeps what it said.
#pragma once

#include <gtest/gtest.h>
#include <sys/types.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/unit/io/temporary_folder.h"

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
  // The same without waiting; wait_for() gives the answer.
  pid_t start(const std::vector<std::string>& args);
  Answer wait_for(pid_t pid);
  // Runs, expects success, and parses what was printed. Messages must not be mixed into it.
  Json run_json(std::vector<std::string> args);
  // Runs, expects a failure of this status, and one message that has `part` in it.
  void expect_error(int status, const std::string& part, const std::vector<std::string>& args);

  // Menger's sponge, 2112 triangles, as m.glb.
  void make_scene();

  bool exists(const std::string& name) const;
  std::string contents(const std::string& name) const;
  void put(const std::string& name, const std::string& bytes) const;

  voxdag::TemporaryFolder folder_;
};

}  // namespace command_line
