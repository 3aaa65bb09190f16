#include <sys/stat.h>

#include <cstdio>
#include <memory>
#include <mutex>
#include <thread>

#include "cli/command.h"
#include "core/base/text.h"
#include "server/api/access/tokens.h"
#include "server/jobs/process/job_process.h"
#include "server/service.h"

namespace voxdag::cli {
namespace {

struct ServeCommand {
  server::ServerConfig options;  // from the command line
  std::string config_file;
};

struct TokenCommand {
  std::string role;
  std::string name;
};

// Writes one line to standard error. Thread-safe.
void log_line(const std::string& line) {
  static std::mutex mutex;
  std::lock_guard lock(mutex);
  std::fprintf(stderr, "%s %s\n", utc_text(time(nullptr), "%Y-%m-%dT%H:%M:%SZ").c_str(),
               line.c_str());
}

// The settings of the file, overridden by the options given.
server::ServerConfig settings(const ServeCommand& command, const CLI::App& app, FileSystem& files) {
  server::ServerConfig config;
  if (!command.config_file.empty()) server::read_config(files, command.config_file, config);
  const auto given = [&](const char* option) { return app.count(option) > 0; };
  if (given("--listen")) config.http.address = command.options.http.address;
  if (given("--port")) config.http.port = command.options.http.port;
  if (given("--data")) config.data_folder = command.options.data_folder;
  if (given("--tokens")) config.token_file = command.options.token_file;
  if (given("--certificate")) config.http.certificate_file = command.options.http.certificate_file;
  if (given("--key")) config.http.key_file = command.options.http.key_file;
  config.adopt = command.options.adopt;
  if (given("--scenes")) config.scene_roots = command.options.scene_roots;
  return config;
}

void serve(const ServeCommand& command, const CLI::App& app, CommandContext& context) {
  umask(0077);  // scenes and results are for clients with a token, not for all users of the machine
  server::Service service(settings(command, app, context.files), context.files, log_line);
  log_line("listening on " + service.url());
  // A signal handler may only set the token, so a thread watches it.
  std::thread watcher([&] {
    while (!context.cancel.canceled()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    log_line("stopping: waiting for builds to reach a checkpoint and answers to finish");
    service.stop();
  });
  const auto end_watcher = [&] {
    context.cancel.cancel();
    watcher.join();
  };
  try {
    service.run();
  } catch (...) {
    end_watcher();
    throw;
  }
  end_watcher();
  log_line("stopped");
}

void make_token(const TokenCommand& command) {
  const server::NewToken made = server::make_token(command.role, command.name);
  std::fprintf(stderr, "The token (shown only once): %s\n", made.token.c_str());
  std::printf("%s\n", made.line.c_str());
}

void add_run_job_command(CLI::App& app, CommandContext& context) {
  // Started by the service only, so hidden from the help.
  CLI::App* command = app.add_subcommand("run-job", "run one job of the service")->group("");
  const auto folder = std::make_shared<std::string>();
  command->add_option("folder", *folder, "folder of the job")->required();
  command->callback([folder, &context] {
    context.exit_status = server::run_job(context.files, *folder, context.cancel);
  });
}

}  // namespace

void add_serve_commands(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("serve", "run the build service (HTTP API and dashboard)");
  const auto state = std::make_shared<ServeCommand>();
  server::ServerConfig& options = state->options;
  command->add_option("--listen", options.http.address,
                      "address to listen on (default: 127.0.0.1)");
  command->add_option("--port", options.http.port,
                      "port to listen on, 0 for any free one (default: 8080)");
  command->add_option("--data", options.data_folder, "data folder: queue, scenes and results");
  command->add_option("--config", state->config_file, "settings in JSON (docs/operating.md)");
  command->add_option("--tokens", options.token_file, "file of hashed bearer tokens");
  command->add_option("--certificate", options.http.certificate_file,
                      "TLS: certificate chain, PEM");
  command->add_option("--key", options.http.key_file, "TLS: its key, PEM");
  command->add_option("--scenes", options.scene_roots,
                      "folder whose scenes jobs may name by path; may be repeated");
  command->add_flag("--adopt", options.adopt,
                    "make new records of jobs and scenes whose records are lost");
  command->callback([state, command, &context] { serve(*state, *command, context); });

  CLI::App* token = app.add_subcommand("token", "create a bearer token for the service");
  const auto made = std::make_shared<TokenCommand>();
  token->add_option("--role", made->role, "read, submit or admin")->required();
  token->add_option("--name", made->name, "name of its owner, for the log")->required();
  token->callback([made] { make_token(*made); });

  add_run_job_command(app, context);
}

}  // namespace voxdag::cli
