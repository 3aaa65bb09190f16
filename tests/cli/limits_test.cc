// Tests that run the program with a limit of the system (ulimit). The program ends with an error
// that names the limit; no limit ends it by a signal.
#include <fcntl.h>
#include <unistd.h>

#include <filesystem>

#include "core/base/process_limits.h"
#include "tests/cli/command_line.h"
#include "tests/cli/serve_process.h"
#include "tests/support/lowered_limit.h"

namespace command_line {
namespace {

using voxdag::LoweredLimit;

class Limits : public CommandLine {
 protected:
  void SetUp() override { make_scene(); }
};

TEST_F(Limits, FileSizesAreNoSpace) {
  ASSERT_EQ(run({"build", "m.glb", "-r", "1024", "-o", "m.vdag"}).status, 0);
  const LoweredLimit lowered(RLIMIT_FSIZE, 16 << 10);
  for (const std::vector<std::string>& args :
       std::vector<std::vector<std::string>>{{"build", "m.glb", "-r", "1024", "-o", "b.vdag"},
                                             {"extract", "m.vdag", "-o", "e.vdag"},
                                             {"export", "m.vdag", "--to", "npz", "-o", "e.npz"},
                                             {"render", "m.vdag", "-o", "r.png"},
                                             {"generate", "menger", "g.glb", "--level", "3"}}) {
    SCOPED_TRACE(args[0]);
    expect_error(7, "ulimit -f, is 16.00 KiB", args);
  }
}

TEST_F(Limits, OpenFilesAreNamed) {
  // Raises the limit until the program starts but its build fails with an error that names the
  // limit. The first limit allows the files that the program inherits, and one more, with which
  // this test redirects the program's output.
  const int unused = open("/dev/null", O_RDONLY);
  close(unused);
  const auto first = static_cast<rlim_t>(unused) + 1;
  Answer answer;
  for (rlim_t files = first; files <= first + 36 && answer.status != 6; ++files) {
    const LoweredLimit lowered(RLIMIT_NOFILE, files);
    answer = run({"build", "m.glb", "-r", "1024", "-o", "b.vdag"});
  }
  EXPECT_EQ(answer.status, 6) << answer.err;
  EXPECT_NE(answer.err.find("ulimit -n, is "), std::string::npos) << answer.err;
}

// Lowers the limit until the build fails. Its error must name the limit. If the program needs more
// address space to load its libraries than to build, it cannot report the limit, and the test is
// skipped.
TEST_F(Limits, AddressSpaceIsNamed) {
  if (VOXDAG_SANITIZED) GTEST_SKIP() << "sanitizers need the address space";
  Answer answer;
  for (rlim_t mib = 400; mib >= 30 && answer.status == 0; mib -= mib > 100 ? 20 : 4) {
    const LoweredLimit lowered(RLIMIT_AS, mib << 20);
    answer = run({"build", "m.glb", "-r", "4096", "-o", "b.vdag", "--threads", "2"});
  }
#ifndef VOXDAG_MODULES
  if (answer.status != 8) GTEST_SKIP() << "the libraries need more memory than the build";
#endif
  EXPECT_EQ(answer.status, 8);
  EXPECT_NE(answer.err.find("ulimit -v, is "), std::string::npos) << answer.err;
}

TEST_F(Limits, AServiceSurvivesALargeUpload) {
  put("big.glb", std::string(3 << 20, 'x'));
  const LoweredLimit lowered(RLIMIT_FSIZE, 1 << 20);
  std::filesystem::create_directory(folder_.file("server"));
  ServeProcess server(folder_.file("server"));
  const Answer answer = run({"submit", "big.glb", "-r", "64", "--server", server.url()});
  EXPECT_NE(answer.status, 0);
  EXPECT_EQ(server.stop(), 0);
}

}  // namespace
}  // namespace command_line
