#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "cli/output.h"
#include "cli/service/run_until_canceled.h"
#include "server/view_service.h"

namespace voxdag::cli {
namespace {

struct ViewCommand {
  std::string input;
  int port = 0;
  bool open = false;
  bool json = false;
};

// Opens `url` in the user's browser. The browser is a detached process, so that signals for one of
// the two processes, such as Ctrl-C, do not end the other.
void open_in_browser(const std::string& url) {
  const pid_t child = fork();
  if (child == 0) {
    const int null = open("/dev/null", O_RDWR);
    for (const int fd : {0, 1, 2}) dup2(null, fd);
    for (const int signal : {SIGPIPE, SIGXFSZ}) std::signal(signal, SIG_DFL);
    setsid();
    if (fork() == 0) execlp("xdg-open", "xdg-open", url.c_str(), nullptr);
    _exit(0);
  }
  if (child > 0) waitpid(child, nullptr, 0);
}

void run(const ViewCommand& command, CommandContext& context) {
  server::ViewService service(command.input, command.port, context.files,
                              [](const server::LogEntry& entry) {
                                std::fprintf(stderr, "voxdag: %s\n", entry.message.c_str());
                              });
  if (command.json)
    print_json_line(nlohmann::ordered_json{{"url", service.url()}});
  else
    std::printf("%s\n", service.url().c_str());
  std::fflush(stdout);
  if (command.open) open_in_browser(service.url());
  run_until_canceled(
      context.cancel, [&] { service.run(); }, [&] { service.stop(); });
}

void declare(Command& command, ViewCommand& state) {
  command.option("input", state.input, "the .vdag file").required();
  command
      .option("--port", state.port,
              "port to listen on, on this machine only (default: any free one)")
      .range(0, 65535);
  command.flag("--open", state.open, "open the page in the browser, by xdg-open");
  command.json_flag(state.json, "print the URL as a JSON object on standard output");
}

}  // namespace

void add_view_command(CommandLine& line) {
  add_command<ViewCommand>(line, "view", "look around in a DAG, in the browser");
}

}  // namespace voxdag::cli
