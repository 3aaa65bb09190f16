#include "tests/cli/command_line.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>

namespace command_line {
namespace {

void redirect(int fd, const std::string& path) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (file < 0 || dup2(file, fd) < 0) _exit(127);
}

}  // namespace

pid_t CommandLine::start(const std::vector<std::string>& args, int output) {
  std::vector<char*> argv = {const_cast<char*>("voxdag")};
  for (const std::string& arg : args) argv.push_back(const_cast<char*>(arg.c_str()));
  argv.push_back(nullptr);
  const pid_t pid = fork();
  if (pid != 0) return pid;
  if (chdir(folder_.path().c_str()) != 0) _exit(127);
  redirect(STDOUT_FILENO, ".stdout");
  if (output >= 0 && dup2(output, STDOUT_FILENO) < 0) _exit(127);
  redirect(STDERR_FILENO, ".stderr");
  execv(VOXDAG_BINARY, argv.data());
  _exit(127);
}

Answer CommandLine::wait_for(pid_t pid) {
  int status = 0;
  EXPECT_EQ(waitpid(pid, &status, 0), pid);
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return {code, contents(".stdout"), contents(".stderr")};
}

Answer CommandLine::run(const std::vector<std::string>& args) { return wait_for(start(args)); }

Json CommandLine::run_json(std::vector<std::string> args) {
  args.push_back("--json");
  const Answer answer = run(args);
  EXPECT_EQ(answer.status, 0) << answer.err;
  const Json json = Json::parse(answer.out, nullptr, false);
  EXPECT_TRUE(json.is_object()) << answer.out;
  return json;
}

void CommandLine::expect_error(int status, const std::string& part,
                               const std::vector<std::string>& args) {
  const Answer answer = run(args);
  EXPECT_EQ(answer.status, status) << answer.err;
  EXPECT_EQ(answer.out, "");
  EXPECT_NE(answer.err.find(part), std::string::npos) << answer.err;
  expect_own_options(answer.err, args);
}

void CommandLine::expect_own_options(const std::string& message,
                                     const std::vector<std::string>& args) {
  static std::map<std::string, std::string> helps;  // by command
  const std::regex named("(voxdag (?:[a-z][a-z-]* )?)?(--[a-z][a-z-]*)( of voxdag [a-z-]+)?");
  for (std::sregex_iterator found(message.begin(), message.end(), named), end; found != end;
       ++found) {
    const std::string option = (*found)[2];
    const auto is_this = [&](const std::string& arg) { return arg.starts_with(option); };
    if ((*found)[1].matched || (*found)[3].matched || std::ranges::any_of(args, is_this)) continue;
    const auto [help, is_new] = helps.emplace(args.empty() ? "" : args[0], "");
    if (is_new) help->second = run({help->first, "--help"}).out;
    EXPECT_TRUE(std::regex_search(help->second, std::regex(option + "[^a-z-]")))
        << "voxdag " << help->first << " does not have " << option << ": " << message;
  }
}

void CommandLine::make_scene() {
  const Answer answer = run({"generate", "menger", "m.glb", "--level", "2"});
  ASSERT_EQ(answer.status, 0) << answer.err;
}

bool CommandLine::exists(const std::string& name) const {
  return std::filesystem::exists(folder_.file(name));
}

std::string CommandLine::contents(const std::string& name) const {
  std::ifstream in(folder_.file(name), std::ios::binary);
  EXPECT_TRUE(in) << name;
  return {std::istreambuf_iterator<char>(in), {}};
}

void CommandLine::put(const std::string& name, const std::string& bytes) const {
  std::ofstream(folder_.file(name), std::ios::binary) << bytes;
}

}  // namespace command_line
