// The commands and their options. Each command has a file with a function
// `add_<name>_command(line)`, which adds the command to the command line. main.cc calls all these
// functions, and turns an Error into a message and an exit status. Only command.cc includes CLI11,
// because CLI11 takes seconds to compile.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/io/file_system.h"
#include "voxdag/cancel_token.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace voxdag::cli {

// Parses exactly kCount numbers separated by `separator`, such as X,Y,Z or WIDTHxHEIGHT. For any
// other text, throws Error{kInvalidInput} with the option's name and `expected`, a description of
// the form.
template <class Number, size_t kCount>
std::array<Number, kCount> parse_list(const std::string& option, const std::string& text,
                                      char separator, const std::string& expected) {
  const auto numbers = parse_numbers<Number, kCount>(text, separator);
  if (!numbers)
    throw Error(ErrorCode::kInvalidInput, option + " '" + text + "': expected " + expected);
  return *numbers;
}

// If `path` is "-", which means the standard output in other programs, returns a text that
// describes the problem. Returns "" for any other path.
std::string path_problem(const std::string& path);

// A handle of a command's option. Each member function returns the handle, so calls can be chained.
class Option {
 public:
  // `max` is the maximum of the option's type, if its values are whole numbers.
  explicit Option(CLI::Option* option, uint64_t max = 0) : option_(option), max_(max) {}
  Option required();
  Option optional();
  Option group(const char* heading);
  // Reads the option's value from an environment variable if the command line does not give the
  // option.
  Option environment(const char* variable);
  Option show_default();
  // For an option whose value is a list: makes each occurrence of the option take one item. Without
  // this call, an occurrence takes all arguments up to the next option.
  Option one_value_each();
  // For options whose values are whole numbers: narrow the accepted range.
  Option positive();
  Option range(int low, int high);
  Option range(double low, double high);
  Option one_of(const std::vector<std::string>& values);
  // Checks each value with `problem`, which returns "" for a valid value, otherwise a text that
  // describes the expected value.
  Option check(std::string (*problem)(const std::string& value));
  Option excludes(Option other);
  Option needs(Option other);

 private:
  CLI::Option* option_;
  uint64_t max_;
};

// A handle of a command. A function that adds an option takes a reference to a variable. Parsing
// the command line sets the variable to the option's value, so the variable must exist until then.
class Command {
 public:
  explicit Command(CLI::App* app) : app_(app) {}
  // Adds an option, or a positional argument if `names` has no dashes. T is a number, a string, an
  // optional double, or a vector of strings.
  template <class T>
  Option option(const char* names, T& value, const char* description);
  // Adds an option of any type. `set` receives the text that the user gave, and throws Error if it
  // is invalid. `value_name` is the placeholder for the value in the help.
  Option text_option(const char* names, const char* value_name,
                     std::function<void(const std::string& text)> set,
                     const std::string& description);
  // Adds an option for a number of voxels per edge, such as 4096 or 4k. `set` receives the number.
  Option edge_option(const char* name, std::function<void(uint64_t edge)> set,
                     const std::string& description);
  Option flag(const char* names, bool& value, const char* description);
  // Adds an option for the name of a file to write.
  Option output_option(const char* names, std::string& path, const char* description);
  Option json_flag(bool& value,
                   const char* description = "report as one JSON object on standard output");
  // Adds --quiet. A command whose output is its result passes another description and still prints
  // this output.
  void quiet_flag(bool& value, const char* description = "print only warnings and errors");
  // Adds --threads, 1 to 1024.
  void threads_option(unsigned& value);
  // Adds the option --memory, whose value is the text of a size.
  void memory_option(std::string& value);
  // Adds the option --config, which names a TOML or INI file. The file sets options that are not on
  // the command line.
  void config_option();
  bool given(const char* option) const;
  void hide();  // Hides the command from the help.
  void on_run(std::function<void()> run);

 private:
  CLI::App* app_;
};

struct CommandContext {
  FileSystem& files;
  CancelToken& cancel;  // canceled by Ctrl-C and SIGTERM
  // Exit status if the command succeeds. `diff` sets it to 1 if the files differ.
  int exit_status = 0;
};

class CommandLine {
 public:
  explicit CommandLine(CommandContext& context);
  ~CommandLine();
  Command add(const char* name, const char* description);
  // Parses the arguments and runs the command. Returns the exit status. Does not catch the
  // command's exceptions.
  int run(int argc, char** argv);
  CommandContext& context() { return context_; }

 private:
  CommandContext& context_;
  std::unique_ptr<CLI::App> app_;
};

// Adds a command whose options set the members of a `State`. The caller's file must define two
// functions in the namespace of `State`: declare(command, state), which adds the options, and
// run(state, context), which is called after the command line is parsed.
template <class State>
State& add_command(CommandLine& line, const char* name, const char* description) {
  Command command = line.add(name, description);
  const auto state = std::make_shared<State>();
  declare(command, *state);
  command.on_run([state, &line] { run(*state, line.context()); });
  return *state;
}

void add_version_command(CommandLine& line);
void add_build_command(CommandLine& line);
// Adds `build-batch`, the hidden command with which a cluster task builds one batch of subvolumes.
void add_build_batch_command(CommandLine& line);
void add_stop_tasks_command(CommandLine& line);
void add_plan_command(CommandLine& line);
void add_status_command(CommandLine& line);
void add_info_command(CommandLine& line);
void add_verify_command(CommandLine& line);
void add_diff_command(CommandLine& line);
void add_generate_command(CommandLine& line);
void add_import_command(CommandLine& line);
void add_render_command(CommandLine& line);
void add_extract_command(CommandLine& line);
void add_combine_command(CommandLine& line);
void add_edit_command(CommandLine& line);
void add_reorder_command(CommandLine& line);
void add_export_command(CommandLine& line);
void add_view_command(CommandLine& line);
void add_publish_command(CommandLine& line);
// Adds `serve`, `token`, and the hidden command that `serve` runs in a child process for each job.
void add_serve_commands(CommandLine& line);
void add_health_command(CommandLine& line);
void add_submit_command(CommandLine& line);
void add_jobs_command(CommandLine& line);
void add_watch_command(CommandLine& line);
// Adds `cancel`, `suspend` and `resume`.
void add_job_action_commands(CommandLine& line);
void add_download_command(CommandLine& line);
void add_exports_command(CommandLine& line);

}  // namespace voxdag::cli
