#include "tests/cli/serve_process.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <iterator>
#include <thread>

namespace command_line {
namespace {

constexpr int kMaxWaitS = 120;  // a slow machine under load

}  // namespace

ServeProcess::ServeProcess(const std::string& folder, const std::vector<std::string>& more,
                           const std::string& port)
    : log_path_(folder + "/serve.log") {
  std::vector<std::string> args = {"voxdag", "serve", "--port", port, "--data", folder + "/data"};
  args.insert(args.end(), more.begin(), more.end());
  std::vector<char*> argv;
  for (std::string& arg : args) argv.push_back(arg.data());
  argv.push_back(nullptr);
  unlink(log_path_.c_str());  // removes the log of an earlier server
  pid_ = fork();
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // if the test is killed, the server also ends
    const int log = open(log_path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    if (log < 0 || dup2(log, STDERR_FILENO) < 0 || dup2(log, STDOUT_FILENO) < 0) _exit(127);
    execv(VOXDAG_BINARY, argv.data());
    _exit(127);
  }
  wait_until_it_listens();
}

ServeProcess::~ServeProcess() { stop(); }

void ServeProcess::wait_until_it_listens() {
  const std::string words = "listening on ";
  for (int i = 0; i < 100 * kMaxWaitS && is_running(); ++i) {
    const std::string text = log();
    const size_t at = text.find(words);
    if (at != std::string::npos && text.find('\n', at) != std::string::npos) {
      const size_t begin = at + words.size();
      url_ = text.substr(begin, text.find_first_of(" \"\n", begin) - begin);
      return;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

bool ServeProcess::is_running() {
  if (pid_ != 0 && waitpid(pid_, nullptr, WNOHANG) != 0) pid_ = 0;
  return pid_ != 0;
}

int ServeProcess::stop() {
  if (pid_ == 0) return 0;
  kill(pid_, SIGTERM);
  int status = 0;
  EXPECT_EQ(waitpid(pid_, &status, 0), pid_);
  pid_ = 0;
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

std::string ServeProcess::log() const {
  std::ifstream in(log_path_, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace command_line
