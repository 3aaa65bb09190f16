// The interface between main.cc and the commands. Each command file defines one function
// `add_<name>_command(app, context)` that adds the command and its options to the parser; main.cc
// calls them all and turns an Error into a message and an exit status.
#pragma once

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <array>
#include <memory>
#include <string>
#include <utility>

#include "core/base/cancel_token.h"
#include "core/base/error.h"
#include "core/base/text.h"
#include "core/io/file_system.h"

namespace voxdag::cli {

// Exactly kCount numbers separated by `separator`, such as X,Y,Z or WIDTHxHEIGHT. Throws
// Error{kInvalidInput} that names the option and says what was `expected`.
template <class Number, size_t kCount>
std::array<Number, kCount> parse_list(const std::string& option, const std::string& text,
                                      char separator, const std::string& expected) {
  const auto numbers = parse_numbers<Number, kCount>(text, separator);
  if (!numbers)
    throw Error(ErrorCode::kInvalidInput, option + " '" + text + "': expected " + expected);
  return *numbers;
}

struct CommandContext {
  FileSystem& files;
  CancelToken& cancel;  // set by Ctrl-C and SIGTERM
  // Exit status of a command that succeeded; diff sets 1 if the files differ.
  int exit_status = 0;
};

// Adds a command whose options set the members of a `State`, which the command owns; after they are
// parsed, `run` is called with the state and the context.
template <class State, class Run>
std::pair<CLI::App*, State*> add_command(CLI::App& app, CommandContext& context, const char* name,
                                         const char* description, Run run) {
  CLI::App* command = app.add_subcommand(name, description);
  const auto state = std::make_shared<State>();
  command->callback([state, run, &context] { run(*state, context); });
  return {command, state.get()};
}

void add_build_command(CLI::App& app, CommandContext& context);
void add_plan_command(CLI::App& app, CommandContext& context);
void add_status_command(CLI::App& app, CommandContext& context);
void add_info_command(CLI::App& app, CommandContext& context);
void add_verify_command(CLI::App& app, CommandContext& context);
void add_diff_command(CLI::App& app, CommandContext& context);
void add_generate_command(CLI::App& app, CommandContext& context);
void add_render_command(CLI::App& app, CommandContext& context);
// Adds `serve`, `token`, and the hidden command that `serve` starts for each job.
void add_serve_commands(CLI::App& app, CommandContext& context);
void add_submit_command(CLI::App& app, CommandContext& context);
void add_jobs_command(CLI::App& app, CommandContext& context);
void add_watch_command(CLI::App& app, CommandContext& context);
void add_cancel_command(CLI::App& app, CommandContext& context);
void add_suspend_command(CLI::App& app, CommandContext& context);
void add_resume_command(CLI::App& app, CommandContext& context);
void add_download_command(CLI::App& app, CommandContext& context);

}  // namespace voxdag::cli
