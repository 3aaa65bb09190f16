#include <cstdio>
#include <ctime>
#include <memory>
#include <mutex>
#include <thread>

#include "cli/command.h"
#include "core/base/clock.h"
#include "server/api/access/tokens.h"
#include "server/jobs/process/job_process.h"
#include "server/service.h"

namespace voxdag::cli {
namespace {

struct ServeCommand {
  server::ServerConfig typed;
  std::string config_file;
};

struct TokenCommand {
  std::string role;
  std::string name;
};

// One line at a time on standard error, where the system's journal takes it.
void log_line(const std::string& line) {
  static std::mutex mutex;
  std::lock_guard lock(mutex);
  const time_t now = time(nullptr);
  tm parts{};
  gmtime_r(&now, &parts);
  char stamp[32];
  strftime(stamp, sizeof stamp, "%Y-%m-%dT%H:%M:%SZ", &parts);
  std::fprintf(stderr, "%s %s\n", stamp, line.c_str());
}

// The file's settings, and over them what was typed.
server::ServerConfig settings(const ServeCommand& command, const CLI::App& app, FileSystem& files) {
  server::ServerConfig config;
  if (!command.config_file.empty()) server::read_config(files, command.config_file, config);
  const auto typed = [&](const char* option) { return app.count(option) > 0; };
  if (typed("--listen")) config.http.address = command.typed.http.address;
  if (typed("--port")) config.http.port = command.typed.http.port;
  if (typed("--data")) config.data_folder = command.typed.data_folder;
  if (typed("--tokens")) config.token_file = command.typed.token_file;
  if (typed("--certificate")) config.http.certificate_file = command.typed.http.certificate_file;
  if (typed("--key")) config.http.key_file = command.typed.http.key_file;
  if (typed("--scenes")) config.scene_roots = command.typed.scene_roots;
  return config;
}

void serve(const ServeCommand& command, const CLI::App& app, CommandContext& context) {
  server::Service service(settings(command, app, context.files), context.files, log_line);
  log_line("listening on " + service.url());
  // Signals set the token; nothing else may be done where they arrive.
  std::thread watcher([&] {
    while (!context.cancel.canceled()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    log_line("stopping: builds stop at a checkpoint, answers finish");
    service.stop();
  });
  service.run();
  context.cancel.cancel();  // the watcher ends too, whatever ended the service
  watcher.join();
  log_line("stopped");
}

void make_token(const TokenCommand& command) {
  const server::NewToken made = server::make_token(command.role, command.name);
  std::fprintf(stderr, "The token, shown this once: %s\n", made.token.c_str());
  std::printf("%s\n", made.line.c_str());
}

void add_run_job_command(CLI::App& app, CommandContext& context) {
  // Started by the service; no part of what users see.
  CLI::App* command = app.add_subcommand("run-job", "do one job of the service")->group("");
  const auto folder = std::make_shared<std::string>();
  command->add_option("folder", *folder, "the job's folder")->required();
  command->callback([folder, &context] {
    context.exit_status = server::run_job(context.files, *folder, context.cancel);
  });
}

}  // namespace

void add_serve_commands(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("serve", "build for others over HTTP");
  const auto state = std::make_shared<ServeCommand>();
  server::ServerConfig& typed = state->typed;
  command->add_option("--listen", typed.http.address, "address to listen on (default: 127.0.0.1)");
  command->add_option("--port", typed.http.port, "its port, 0 for any free one (default: 8080)");
  command->add_option("--data", typed.data_folder, "folder of the queue, scenes and results");
  command->add_option("--config", state->config_file, "settings in JSON (docs/operating.md)");
  command->add_option("--tokens", typed.token_file, "file of hashed bearer tokens");
  command->add_option("--certificate", typed.http.certificate_file, "TLS: certificate chain, PEM");
  command->add_option("--key", typed.http.key_file, "TLS: its key, PEM");
  command->add_option("--scenes", typed.scene_roots,
                      "folder whose scenes jobs may name by path; may be repeated");
  command->callback([state, command, &context] { serve(*state, *command, context); });

  CLI::App* token = app.add_subcommand("token", "make a bearer token for the service");
  const auto made = std::make_shared<TokenCommand>();
  token->add_option("--role", made->role, "read, submit or admin")->required();
  token->add_option("--name", made->name, "whose it is")->required();
  token->callback([made] { make_token(*made); });

  add_run_job_command(app, context);
}

}  // namespace voxdag::cli
