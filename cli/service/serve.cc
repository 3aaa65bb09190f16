#include <sys/stat.h>

#include <cstdio>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>

#include "cli/output.h"
#include "cli/service/run_until_canceled.h"
#include "core/base/clock.h"
#include "core/fields/field.h"
#include "server/api/access/tokens.h"
#include "server/jobs/process/job_process.h"
#include "server/service.h"

namespace voxdag::cli {
namespace {

struct ServeCommand {
  server::ServerConfig options;  // from the command line
  std::string config_file, log_format;
  bool json = false;
};

struct TokenCommand {
  std::string role;
  std::string name;
  bool json = false;
};

// Writes entries to standard error, one line each. Thread-safe.
server::Log log_to_stderr(server::LogFormat format) {
  return [format](const server::LogEntry& entry) {
    static std::mutex mutex;
    const std::lock_guard lock(mutex);
    std::fprintf(stderr, "%s\n", server::log_line(format, entry, unix_seconds()).c_str());
  };
}

// Returns the settings of the service from the configuration file and the command line, whose
// options take precedence.
server::ServerConfig settings(const ServeCommand& command, const Command& line, FileSystem& files) {
  server::ServerConfig config;
  if (!command.config_file.empty()) server::read_config(files, command.config_file, config);
  const auto given = [&](const char* option) { return line.given(option); };
  if (given("--listen")) config.http.address = command.options.http.address;
  if (given("--port")) config.http.port = command.options.http.port;
  if (given("--data")) config.data_folder = command.options.data_folder;
  if (given("--tokens")) config.token_file = command.options.token_file;
  if (given("--certificate")) config.http.certificate_file = command.options.http.certificate_file;
  if (given("--key")) config.http.key_file = command.options.http.key_file;
  config.adopt = command.options.adopt;
  if (given("--scenes")) config.scene_roots = command.options.scene_roots;
  if (given("--log-format")) config.log_format = *enum_of<server::LogFormat>(command.log_format);
  if (given("--access-log")) config.access_log = command.options.access_log;
  return config;
}

void serve(const ServeCommand& command, const Command& line, CommandContext& context) {
  // Makes new files private to the user who runs the service. Otherwise all users of the machine
  // could read scenes and results, not only clients with a token.
  umask(0077);
  const server::ServerConfig config = settings(command, line, context.files);
  const server::Log log = log_to_stderr(config.log_format);
  server::Service service(config, context.files, log);
  log("listening on " + service.url());
  if (command.json) print_json_line(nlohmann::ordered_json{{"url", service.url()}});
  std::fflush(stdout);
  run_until_canceled(
      context.cancel, [&] { service.run(); },
      [&] {
        log("stopping: waiting for builds to reach a checkpoint and answers to finish");
        service.stop();
      });
  log("stopped");
}

void declare(Command& command, TokenCommand& state) {
  command.option("--role", state.role, "read, submit or admin").required();
  command.option("--name", state.name, "name of its owner, for the log").required();
  command.json_flag(state.json, "the token and its line as one JSON object on standard output");
}

void run(const TokenCommand& command, CommandContext&) {
  const server::NewToken made = server::make_token(command.role, command.name);
  if (command.json)
    return print_json(nlohmann::ordered_json{{"role", command.role},
                                             {"name", command.name},
                                             {"token", made.token},
                                             {"line", made.line}});
  std::fprintf(stderr, "The token (shown only once): %s\n", made.token.c_str());
  std::printf("%s\n", made.line.c_str());
}

// Adds the hidden command `run-job`, which the service starts as a child process for each job.
void add_run_job_command(CommandLine& line) {
  Command command = line.add("run-job", "run one job of the service");
  command.hide();
  const auto folder = std::make_shared<std::string>();
  command.option("folder", *folder, "folder of the job").required();
  command.on_run([folder, &context = line.context()] {
    context.exit_status = server::run_job(context.files, *folder, context.cancel);
  });
}

}  // namespace

void add_serve_commands(CommandLine& line) {
  Command command = line.add("serve", "run the build service (HTTP API and dashboard)");
  const auto state = std::make_shared<ServeCommand>();
  server::ServerConfig& options = state->options;
  command.option("--listen", options.http.address, "address to listen on (default: 127.0.0.1)");
  command
      .option("--port", options.http.port, "port to listen on, 0 for any free one (default: 8080)")
      .range(0, 65535);
  command.option("--data", options.data_folder, "data folder: queue, scenes and results");
  command.option("--config", state->config_file, "settings in JSON (docs/operating.md)");
  command.option("--tokens", options.token_file, "file of hashed bearer tokens");
  command.option("--certificate", options.http.certificate_file, "TLS: certificate chain, PEM");
  command.option("--key", options.http.key_file, "TLS: its key, PEM");
  command.option("--scenes", options.scene_roots,
                 "folder whose scenes jobs may name by path; may be repeated");
  command
      .option("--log-format", state->log_format,
              "format of the log: text (default), or json, one object per line")
      .one_of(choices_of<server::LogFormat>());
  command.flag("--access-log", options.access_log, "also log requests that change nothing");
  command.flag("--adopt", options.adopt,
               "make new records of jobs and scenes whose records are lost");
  command.json_flag(state->json, "print the URL as one line of JSON on standard output");
  command.on_run([state, command, &line] { serve(*state, command, line.context()); });

  add_command<TokenCommand>(line, "token", "create a bearer token for the service");
  add_run_job_command(line);
}

}  // namespace voxdag::cli
