#include "cli/command.h"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <sstream>
#include <type_traits>
#include <utility>

#include "cli/syntax/closest_word.h"
#include "core/base/options/option_text.h"
#include "core/fields/field.h"

namespace voxdag::cli {
namespace {

constexpr uint64_t kMaxConfigBytes = uint64_t{1} << 20;

// Returns the key of a line of a TOML or INI file, without its comment: "threads" for `threads =
// 4`. Returns "" for other lines.
std::string config_key(std::string line) {
  line.erase(std::min(line.find('='), line.size()));
  std::string key = CLI::detail::trim(line);
  CLI::detail::remove_quotes(key);
  constexpr const char* kAllowed =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_";
  const bool is_key = !key.empty() && !std::isdigit(static_cast<unsigned char>(key[0])) &&
                      key.find_first_not_of(kAllowed) == std::string::npos;
  return is_key ? key : "";
}

// Throws if a file of options gives an option of `command` twice. CLI11 joins the values, and only
// the last one would count.
void check_config_keys(const std::string& path, const std::string& text, const CLI::App& command) {
  std::map<const CLI::Option*, size_t> lines;
  long open = 0;  // brackets of an array that continues on the next line
  std::istringstream rest(text);
  std::string line;
  for (size_t number = 1; std::getline(rest, line); ++number) {
    line.erase(std::min(line.find_first_of("#;"), line.size()));
    const bool is_item = open > 0;
    const std::string trimmed = CLI::detail::trim_copy(line);
    if (!is_item && trimmed.starts_with('[')) {
      if (trimmed != "[default]") break;  // the keys of other sections are not options
      continue;
    }
    open += std::ranges::count(line, '[') - std::ranges::count(line, ']');
    const std::string key = is_item ? "" : config_key(line);
    const CLI::Option* const option =
        key.empty() ? nullptr : command.get_option_no_throw("--" + key);
    if (!option) continue;
    const auto [first, is_new] = lines.emplace(option, number);
    if (!is_new)
      throw Error(ErrorCode::kInvalidInput, path + ":" + std::to_string(number) + ": '" + key +
                                                "' is given several times, first in line " +
                                                std::to_string(first->second) +
                                                ": expected it once");
  }
}

// Reads a TOML or INI file, and sets the options that the command line does not give. CLI11 itself
// supports such files only for the complete program, not for a single command.
void read_config_file(const std::string& path, CLI::App& command) {
  const std::string bytes = read_small_file(system_files(), path, kMaxConfigBytes);
  check_config_keys(path, bytes, command);
  std::istringstream text(bytes);
  for (const CLI::ConfigItem& item : CLI::ConfigTOML().from_config(text)) {
    CLI::Option* const option = command.get_option_no_throw("--" + item.fullname());
    if (!option || !option->get_configurable())
      throw Error(ErrorCode::kInvalidInput,
                  path + ": '" + item.fullname() + "' is not an option of " + command.get_name());
    if (option->count() > 0) continue;
    // If the command line gives the option after --config, the option gets a second value later.
    // TakeLast selects this later value.
    option->multi_option_policy(CLI::MultiOptionPolicy::TakeLast)->add_result(item.inputs);
  }
}

const CLI::App* g_running_command = nullptr;

bool has_option(const CLI::App& command, const std::string& option) {
  return command.get_option_no_throw(option) != nullptr;
}

// Spells an option for the users of the running command. Options of only `voxdag build` are marked:
// commands such as `edit` and `status` share code with `build`, and its messages recommend options.
// Hidden commands run on behalf of `build`.
std::string spell_for_running_command(std::string_view name, std::string_view value) {
  const CLI::App& command = *g_running_command;
  const std::string option = spell_for_command_line(name, {});
  const std::string text = spell_for_command_line(name, value);
  if (command.get_group().empty() || has_option(command, option)) return text;
  if (name == "allow_empty") return "";  // edit has no such option
  const auto is_build = [](const CLI::App* other) { return other->get_name() == "build"; };
  const CLI::App& all = *command.get_parent();
  for (const CLI::App* build : all.get_subcommands(is_build))
    if (has_option(*build, option)) return text + " of voxdag build";
  return text;
}

constexpr Audience kCommandUsers{&spell_for_running_command, kCommandLineUsers.spell_command,
                                 kCommandLineUsers.repeat};

constexpr const char* kWholeNumber = "whole number";  // name of the check of such an option

// Returns a check for whole numbers from `low` to `high`. CLI11's own conversion is not used,
// because it turns -4 into 2^64 - 4 for unsigned types, and its errors do not state the expected
// value.
std::function<std::string(std::string&)> whole_number_check(int64_t low, uint64_t high) {
  return [low, high](const std::string& text) -> std::string {
    const auto is_signed = parse_numbers<int64_t, 1>(text, ',');
    const auto is_unsigned = parse_numbers<uint64_t, 1>(text, ',');
    if (is_unsigned ? (*is_unsigned)[0] <= high && (!is_signed || (*is_signed)[0] >= low)
                    : is_signed && (*is_signed)[0] >= low)
      return "";
    return "'" + text + "': expected a whole number from " + std::to_string(low) + " to " +
           std::to_string(high);
  };
}

// Replaces forms of `help` and `version` that CLI11 does not know: `help build` becomes `build
// --help`, and `--version` and `-V` become the command `version`.
std::vector<std::string> in_full(std::vector<std::string> words) {
  if (words.empty()) return words;
  if (words[0] == "help") {
    words.erase(words.begin());
    words.insert(words.begin() + (words.empty() ? 0 : 1), "--help");
  } else if (words[0] == "--version" || words[0] == "-V") {
    words[0] = "version";
  }
  return words;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({}))
    if (!command->get_group().empty()) names.push_back(command->get_name());
  return names;
}

std::vector<std::string> long_options(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  return names;
}

// Throws unless the first argument is the name of a command or begins with a dash, as options do.
void check_command(const CLI::App& app, const std::vector<std::string>& words) {
  const std::string hint = "'voxdag --help' describes the commands";
  if (words.empty())
    throw Error(ErrorCode::kInvalidInput, "no command was given: expected one; " + hint);
  const std::string& word = words[0];
  const auto has_name = [&](const CLI::App* command) { return command->get_name() == word; };
  if (word.starts_with("-") || std::ranges::any_of(app.get_subcommands({}), has_name)) return;
  const std::vector<std::string> names = command_names(app);
  throw Error(ErrorCode::kInvalidInput, "unknown command '" + word + "': expected one of " +
                                            joined(names) + suggestion(word, names));
}

// Throws if the parsed command line has arguments that the command does not know. Called when
// parsing fails. CLI11 reports a missing argument before unknown ones, but an unknown argument is
// often a mistyped form of the missing one.
void check_arguments(const CLI::App& app) {
  const auto commands = app.get_subcommands();
  const CLI::App& command = commands.empty() ? app : *commands.front();
  const std::vector<std::string> unknown = command.remaining();
  if (unknown.empty()) return;
  const auto is_option = [](const std::string& word) { return word.starts_with("-"); };
  const auto option = std::find_if(unknown.begin(), unknown.end(), is_option);
  const std::string place = commands.empty() ? "" : command.get_name() + ": ";
  const std::string hint =
      commands.empty() ? "'voxdag --help'" : "'voxdag help " + command.get_name() + "'";
  if (option == unknown.end())
    throw Error(ErrorCode::kInvalidInput, place + "unexpected argument '" + unknown.front() +
                                              "': expected the arguments that " + hint +
                                              " describes");
  const std::string name = option->substr(0, option->find('='));
  throw Error(ErrorCode::kInvalidInput, place + "unknown option '" + name +
                                            "': expected an option that " + hint + " describes" +
                                            suggestion(name, long_options(command)));
}

// Returns a validator that accepts the same values as `validator`. Its message has the form of the
// other messages: the value, and the expected values.
CLI::Validator expecting(const std::string& expected, const CLI::Validator& validator) {
  return {[expected, validator](std::string& text) {
            return validator(text).empty() ? "" : "'" + text + "': expected " + expected;
          },
          validator.get_description()};
}

// Returns the message of an error that CLI11 found. `command` is the name of the command, or "".
std::string message_of(const CLI::ParseError& error, const std::string& command) {
  const std::string text = error.what();
  const std::string option = text.substr(0, text.find(':'));
  if (text.starts_with(option + ": At Most"))
    return option + " is given several times: expected it once";
  if (text.starts_with(option + ": ") && text.ends_with(" missing"))
    return option + " has no value: expected one";
  constexpr std::string_view kExcludes = " excludes ", kRequires = " requires --";
  if (const size_t at = text.find(kExcludes); at != text.npos)
    return text.substr(0, at) + " and " + text.substr(at + kExcludes.size()) +
           " are both given: expected one of them";
  if (const size_t at = text.find(kRequires); at != text.npos)
    return text.substr(0, at) + " is given without " +
           text.substr(at + kRequires.size() - strlen("--")) + ": expected both";
  constexpr std::string_view kIsRequired = " is required";
  if (!text.starts_with("-") && text.ends_with(kIsRequired))
    return (command.empty() ? "" : command + ": ") + "the argument '" +
           text.substr(0, text.size() - kIsRequired.size()) +
           "' is required: expected the arguments that 'voxdag help" +
           (command.empty() ? "" : " " + command) + "' describes";
  return text;
}

}  // namespace

std::string path_problem(const std::string& path) {
  return path == "-" ? "'-': expected the name of a file; files are not written to the standard "
                       "output"
                     : "";
}

Option Option::required() { return Option(option_->required(), max_); }
Option Option::optional() { return Option(option_->required(false), max_); }
Option Option::group(const char* heading) { return Option(option_->group(heading), max_); }
Option Option::environment(const char* variable) {
  return Option(option_->envname(variable), max_);
}
Option Option::show_default() { return Option(option_->capture_default_str(), max_); }
Option Option::one_value_each() { return Option(option_->allow_extra_args(false), max_); }
Option Option::positive() {
  option_->get_validator(kWholeNumber)
      ->operation(whole_number_check(1, max_))
      .description("POSITIVE");
  return *this;
}
Option Option::range(int low, int high) {
  option_->get_validator(kWholeNumber)
      ->operation(whole_number_check(low, static_cast<uint64_t>(high)))
      .description(CLI::Range(low, high).get_description());
  return *this;
}
Option Option::range(double low, double high) {
  return Option(option_->check(expecting(
      "a number from " + number_text(low) + " to " + number_text(high), CLI::Range(low, high))));
}
Option Option::one_of(const std::vector<std::string>& values) {
  return Option(option_->check(expecting("one of " + joined(values), CLI::IsMember(values))));
}
Option Option::check(std::string (*problem)(const std::string&)) {
  return Option(option_->check(problem), max_);
}
Option Option::excludes(Option other) { return Option(option_->excludes(other.option_), max_); }
Option Option::needs(Option other) { return Option(option_->needs(other.option_), max_); }

template <class T>
Option Command::option(const char* names, T& value, const char* description) {
  CLI::Option* const option = app_->add_option(names, value, description);
  using Number = std::conditional_t<std::is_same_v<T, std::optional<uint64_t>>, uint64_t, T>;
  if constexpr (std::is_integral_v<Number>) {
    using Limits = std::numeric_limits<Number>;
    option->check(
        CLI::Validator(whole_number_check(Limits::min(), Limits::max()), "", kWholeNumber));
    return Option(option, Limits::max());
  }
  return Option(option);
}
template Option Command::option(const char*, int&, const char*);
template Option Command::option(const char*, unsigned&, const char*);
template Option Command::option(const char*, uint64_t&, const char*);
template Option Command::option(const char*, double&, const char*);
template Option Command::option(const char*, std::optional<double>&, const char*);
template Option Command::option(const char*, std::optional<uint64_t>&, const char*);
template Option Command::option(const char*, std::string&, const char*);
template Option Command::option(const char*, std::vector<std::string>&, const char*);

Option Command::text_option(const char* names, const char* value_name,
                            std::function<void(const std::string&)> set,
                            const std::string& description) {
  return Option(app_->add_option_function<std::string>(names, std::move(set), description)
                    ->type_name(value_name));
}

Option Command::edge_option(const char* name, std::function<void(uint64_t)> set,
                            const std::string& description) {
  return text_option(
      name, "N",
      [name = std::string(name), set = std::move(set)](const std::string& text) {
        const auto edge = edge_of_text(text);
        if (!edge)
          throw Error(ErrorCode::kInvalidInput,
                      name + ": '" + text + "': expected a number of voxels such as 4096 or 4k");
        set(*edge);
      },
      description);
}

Option Command::flag(const char* names, bool& value, const char* description) {
  return Option(app_->add_flag(names, value, description));
}

Option Command::output_option(const char* names, std::string& path, const char* description) {
  return option(names, path, description).check(path_problem);
}

Option Command::json_flag(bool& value, const char* description) {
  return flag("--json", value, description);
}

void Command::quiet_flag(bool& value, const char* description) {
  flag("-q,--quiet", value, description);
}

void Command::threads_option(unsigned& value) {
  option("--threads", value, "worker threads (default: all cores)").range(1, 1024);
}

void Command::memory_option(std::string& value) {
  option("--memory", value,
         "memory to use, such as 512MiB (default: half of the machine's; at least 64MiB)");
}

void Command::config_option() {
  app_->add_option_function<std::string>(
          "--config", [app = app_](const std::string& path) { read_config_file(path, *app); },
          "read options from a TOML or INI file")
      ->trigger_on_parse()
      ->configurable(false);
}

bool Command::given(const char* option) const { return app_->count(option) > 0; }
void Command::hide() { app_->group(""); }
void Command::on_run(std::function<void()> run) {
  app_->callback([app = app_, run = std::move(run)] {
    g_running_command = app;
    set_audience(kCommandUsers);
    run();
  });
}

CommandLine::CommandLine(CommandContext& context)
    : context_(context),
      app_(std::make_unique<CLI::App>(
          "voxdag: builds sparse voxel DAGs of huge triangle scenes, out of core", "voxdag")) {
  app_->set_version_flag("-V,--version", VOXDAG_VERSION,
                         "Print the version; --version --verbose also prints the commit and the "
                         "features");
  app_->require_subcommand(1);
  app_->footer("voxdag help COMMAND prints the options of a command.");
}

CommandLine::~CommandLine() = default;

Command CommandLine::add(const char* name, const char* description) {
  CLI::App* const command = app_->add_subcommand(name, description);
  command->footer("");  // the inherited footer is only for the list of commands
  return Command(command);
}

int CommandLine::run(int argc, char** argv) {
  std::vector<std::string> words = in_full({argv + 1, argv + argc});
  check_command(*app_, words);
  std::reverse(words.begin(), words.end());  // CLI11 requires the reverse order
  try {
    app_->parse(std::move(words));
  } catch (const CLI::ParseError& error) {
    // CLI11 reports --help and --version as errors with status 0.
    if (error.get_exit_code() == 0) {
      std::ostringstream text;
      const int status = app_->exit(error, text, text);
      std::fputs(text.str().c_str(), stdout);
      return status;
    }
    check_arguments(*app_);
    const auto commands = app_->get_subcommands();
    throw Error(ErrorCode::kInvalidInput,
                message_of(error, commands.empty() ? "" : commands.front()->get_name()));
  }
  return context_.exit_status;
}

}  // namespace voxdag::cli
