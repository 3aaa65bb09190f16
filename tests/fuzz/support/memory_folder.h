// A temporary folder for the files of a fuzz target.
#pragma once

#include <stdlib.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/fuzz/support/fuzz_target.h"

namespace voxdag::fuzz {

// Returns the path of a folder in memory, if the system has one. The folder is created by the first
// call and removed when the process exits.
inline const std::string& memory_folder() {
  static const std::string path = [] {
    std::string name = std::filesystem::is_directory("/dev/shm") ? "/dev/shm" : "/tmp";
    name += "/voxdag-fuzz-XXXXXX";
    require(mkdtemp(name.data()) != nullptr, "a folder can be made");
    static std::string made = name;
    std::atexit([] { std::filesystem::remove_all(made); });
    return name;
  }();
  return path;
}

}  // namespace voxdag::fuzz
