#include "cli/command.h"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <limits>
#include <optional>
#include <sstream>
#include <type_traits>

namespace voxdag::cli {
namespace {

constexpr uint64_t kMaxConfigBytes = uint64_t{1} << 20;

// Reads a TOML or INI file, and sets the options that the command line does not give. CLI11 itself
// supports such files only for the complete program, not for a single command.
void read_config_file(const std::string& path, CLI::App& command) {
  std::istringstream text(read_small_file(system_files(), path, kMaxConfigBytes));
  for (const CLI::ConfigItem& item : CLI::ConfigTOML().from_config(text)) {
    CLI::Option* const option = command.get_option_no_throw("--" + item.fullname());
    if (!option || !option->get_configurable())
      throw Error(ErrorCode::kInvalidInput,
                  path + ": '" + item.fullname() + "' is not an option of " + command.get_name());
    if (option->count() > 0) continue;
    // The command line may give the option after --config; then TakeLast lets the command line's
    // value win.
    option->multi_option_policy(CLI::MultiOptionPolicy::TakeLast)->add_result(item.inputs);
  }
}

// Returns "" for a valid number, otherwise an error message. CLI11's own conversion is not used: it
// turns -4 into 2^64 - 4, and its errors do not state the expected value.
template <class T>
std::string integer_problem(const std::string& text) {
  if (parse_numbers<T, 1>(text, ',')) return "";
  using Limits = std::numeric_limits<T>;
  return "'" + text + "': expected a whole number from " + std::to_string(Limits::min()) + " to " +
         std::to_string(Limits::max());
}

}  // namespace

Option Option::required() { return Option(option_->required()); }
Option Option::group(const char* heading) { return Option(option_->group(heading)); }
Option Option::environment(const char* variable) { return Option(option_->envname(variable)); }
Option Option::show_default() { return Option(option_->capture_default_str()); }
Option Option::one_value_each() { return Option(option_->allow_extra_args(false)); }
Option Option::positive() {
  const auto problem = [](const std::string& text) {
    const bool positive = text.find_first_of("123456789") != std::string::npos;
    return positive ? "" : "'" + text + "': expected a number above 0";
  };
  return Option(option_->check(problem, "POSITIVE"));
}
Option Option::range(int low, int high) { return Option(option_->check(CLI::Range(low, high))); }
Option Option::range(double low, double high) {
  return Option(option_->check(CLI::Range(low, high)));
}
Option Option::one_of(const std::vector<std::string>& values) {
  return Option(option_->check(CLI::IsMember(values)));
}
Option Option::check(std::string (*problem)(const std::string&)) {
  return Option(option_->check(problem));
}
Option Option::excludes(Option other) { return Option(option_->excludes(other.option_)); }
Option Option::needs(Option other) { return Option(option_->needs(other.option_)); }

template <class T>
Option Command::option(const char* names, T& value, const char* description) {
  CLI::Option* const option = app_->add_option(names, value, description);
  if constexpr (std::is_integral_v<T>) option->check(integer_problem<T>);
  if constexpr (std::is_same_v<T, std::optional<uint64_t>>)
    option->check(integer_problem<uint64_t>);
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

Option Command::flag(const char* names, bool& value, const char* description) {
  return Option(app_->add_flag(names, value, description));
}

void Command::json_flag(bool& value, const char* description) {
  flag("--json", value, description);
}

void Command::threads_option(unsigned& value) {
  option("--threads", value, "worker threads (default: all cores)").range(1, 1024);
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
void Command::on_run(std::function<void()> run) { app_->callback(std::move(run)); }

CommandLine::CommandLine(CommandContext& context)
    : context_(context),
      app_(std::make_unique<CLI::App>(
          "voxdag: builds sparse voxel DAGs of huge triangle scenes, out of core", "voxdag")) {
  app_->set_version_flag("--version", VOXDAG_VERSION);
  app_->require_subcommand(1);
}

CommandLine::~CommandLine() = default;

Command CommandLine::add(const char* name, const char* description) {
  return Command(app_->add_subcommand(name, description));
}

int CommandLine::run(int argc, char** argv) {
  try {
    app_->parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // CLI11 reports --help and --version as errors with status 0.
    if (error.get_exit_code() == 0) return app_->exit(error);
    throw Error(ErrorCode::kInvalidInput, error.what());
  }
  return context_.exit_status;
}

}  // namespace voxdag::cli
