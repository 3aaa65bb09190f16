// The modules (cli/modules): parts of voxdag that the program loads only when it needs them.
#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>

#include "tests/cli/command_line.h"

namespace command_line {
namespace {

namespace fs = std::filesystem;

class Modules : public CommandLine {
 protected:
  void SetUp() override {
#ifndef VOXDAG_MODULES
    GTEST_SKIP() << "this program is linked with all of its libraries";
#endif
  }
};

// Returns what `command` writes to standard output.
std::string output_of(const std::string& command) {
  FILE* const pipe = popen(command.c_str(), "r");
  std::string text;
  std::array<char, 4096> part;
  while (const size_t bytes = fread(part.data(), 1, part.size(), pipe))
    text.append(part.data(), bytes);
  EXPECT_EQ(pclose(pipe), 0) << command;
  return text;
}

TEST_F(Modules, TheProgramStartsWithoutTheirLibraries) {
  const std::string libraries = output_of("LD_TRACE_LOADED_OBJECTS=1 '" VOXDAG_BINARY "'");
  EXPECT_NE(libraries.find("libc.so"), std::string::npos);
  for (const char* name :
       {"libopenvdb", "libtbb", "libavif", "libassimp", "libcpp-httplib", "libbrotli"})
    EXPECT_EQ(libraries.find(name), std::string::npos) << libraries;
}

// A copy of the program without its modules has all commands that need none, and names the module
// that a command lacks. The error is `io`, because the user's input is not the cause.
TEST_F(Modules, AMissingModuleIsNamed) {
  make_scene();
  ASSERT_EQ(run({"build", "m.glb", "-r", "64", "-o", "m.vdag"}).status, 0);
  fs::copy(VOXDAG_BINARY, folder_.file("voxdag"));
  const std::string in_folder = "cd '" + folder_.path() + "' && ";
  EXPECT_EQ(output_of(in_folder + "./voxdag --version"), run({"--version"}).out);
#ifdef VOXDAG_HAS_VDB
  const std::string error = output_of(
      in_folder + "./voxdag export m.vdag --to nvdb -o m.nvdb --quiet 2>&1 || test $? = 6");
  for (const char* part : {"incomplete: expected the file", "voxdag-vdb.so"})
    EXPECT_NE(error.find(part), std::string::npos) << error;
  EXPECT_FALSE(exists("m.nvdb"));
  EXPECT_FALSE(exists("m.nvdb.partial"));
  // A file that is no library.
  std::filesystem::create_directories(folder_.file("lib/voxdag"));
  put("lib/voxdag/voxdag-vdb.so", "text");
  EXPECT_NE(output_of(in_folder + "./voxdag export m.vdag --to vdb -o m.vdb 2>&1 || test $? = 6")
                .find("cannot load a part of voxdag: "),
            std::string::npos);
#endif
}

#ifdef VOXDAG_HAS_VDB
// The list of temporary files, the damage of mapped files and the spelling of options must exist
// once in a process. So a module uses the program's functions for them.
TEST_F(Modules, UseTheStateOfTheProgram) {
  make_scene();
  ASSERT_EQ(run({"build", "m.glb", "-r", "64", "-o", "m.vdag"}).status, 0);
  const std::string bindings =
      output_of("cd '" + folder_.path() +
                "' && LD_DEBUG=bindings '" VOXDAG_BINARY
                "' export m.vdag --to vdb -o m.vdb 2>&1 | grep 'file [^ ]*voxdag-vdb.so'");
  for (const char* name : {"13TemporaryPathC", "14WatchedMapping10is_damaged", "11option_text"}) {
    const size_t at = bindings.find(name);
    ASSERT_NE(at, std::string::npos) << name;
    const size_t line = bindings.rfind('\n', at) + 1;
    EXPECT_NE(bindings.substr(line, at - line).find("to " VOXDAG_BINARY " "), std::string::npos)
        << bindings.substr(line, at - line);
  }
}
#endif

}  // namespace
}  // namespace command_line
