#include "scheduler/slurm/commands/slurm.h"

#include <algorithm>
#include <charconv>
#include <sstream>
#include <thread>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/options/option_text.h"

namespace voxdag {
namespace {

// Slurm's default of MaxArraySize, which is one more than the largest index of an array.
constexpr uint32_t kDefaultMaxArraySize = 1001;
constexpr size_t kMaxTasksOfCommand = 200;  // tasks in one scancel command

std::string trimmed(std::string text) {
  while (!text.empty() && std::string_view(" \t\r\n").find(text.back()) != std::string_view::npos)
    text.pop_back();
  return text;
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, separator);) parts.push_back(part);
  return parts;
}

std::optional<uint32_t> number(const std::string& text) {
  uint32_t value = 0;
  const char* const end = text.data() + text.size();
  const auto [rest, failure] = std::from_chars(text.data(), end, value);
  if (failure != std::errc{} || rest != end) return std::nullopt;
  return value;
}

// Returns "3,7-9" for 3, 7, 8, 9.
std::string ranges(const std::vector<uint32_t>& sorted) {
  std::string text;
  for (size_t i = 0; i < sorted.size();) {
    size_t last = i;
    while (last + 1 < sorted.size() && sorted[last + 1] == sorted[last] + 1) ++last;
    if (!text.empty()) text += ',';
    text += std::to_string(sorted[i]);
    if (last > i) text += '-' + std::to_string(sorted[last]);
    i = last + 1;
  }
  return text;
}

std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word)
    if (c == '\'')
      text += "'\\''";
    else
      text += c;
  return text + "'";
}

// Returns a shell script that runs a command. The last line has no newline, so that the caller can
// append an argument.
std::string script_line(const std::vector<std::string>& command) {
  std::string line = "#!/bin/sh\nexec";
  for (const std::string& word : command) line += " " + quoted(word);
  return line;
}

// Returns sbatch's option for the log file `name` in the log folder. Escapes % in the path of the
// folder, because sbatch replaces patterns such as %A. Only `name` may contain such patterns.
std::string output_option(const std::string& log_folder, const std::string& name) {
  std::string option = "--output=";
  for (const char c : log_folder) option += c == '%' ? "%%" : std::string(1, c);
  return option + "/" + name;
}

// Returns the value in "... NAME=value ...", up to the next blank; "" if `text` has no such field
// or its value is "(null)".
std::string field(const std::string& text, const std::string& name) {
  size_t at = text.find(name + "=");
  while (at != std::string::npos && at > 0 && text[at - 1] != ' ')
    at = text.find(name + "=", at + 1);
  if (at == std::string::npos) return "";
  at += name.size() + 1;
  const std::string value = text.substr(at, text.find(' ', at) - at);
  return value == "(null)" ? "" : trimmed(value);
}

// True if the next word can be the option's value.
bool takes_next_word(const std::string& option) {
  return option.starts_with("--") ? option.find('=') == std::string::npos
                                  : option.starts_with('-') && option.size() == 2;
}

// True if Slurm could not be reached or did not answer, so that a later attempt can succeed.
bool is_unreachable(const CommandResult& result) {
  for (const char* sign : {"Unable to contact", "Connection refused", "timed out", "Socket timed",
                           "Zero Bytes", "communications", "temporarily", "try again"})
    if (result.error.find(sign) != std::string::npos) return true;
  return result.exit_status >= 128;
}

// True if sbatch refused an array because the array, or all jobs of the user together, would exceed
// a limit of Slurm.
bool is_too_much(const CommandResult& result) {
  for (const char* sign : {"MaxJobCount", "MaxSubmitJob", "MaxSubmitPU", "job submit limit"})
    if (result.error.find(sign) != std::string::npos) return true;
  return false;
}

// Implements is_held(). Slurm's commands print the words of a reason with blanks or underscores
// between them.
bool is_held_forever(const std::string& state, std::string reason) {
  std::ranges::replace(reason, ' ', '_');
  return state == "PENDING" &&
         (reason == "launch_failed_requeued_held" || reason == "JobHoldMaxRequeue");
}

}  // namespace

bool SlurmTask::is_held() const { return is_held_forever(state, reason); }

bool SlurmJob::is_held() const { return is_held_forever(state, reason); }

std::string SlurmEnd::text() const {
  if (state.empty()) return "ended, and Slurm no longer reports how";
  std::string text = state;
  if (!reason.empty() && reason != "None") text += ", " + reason;
  if (!exit_code.empty() && exit_code != "0:0") text += ", exit code " + exit_code;
  return text;
}

bool SlurmEnd::is_active() const {
  for (const char* active : {"PENDING", "RUNNING", "COMPLETING", "CONFIGURING", "SUSPENDED",
                             "REQUEUED", "REQUEUE_HOLD", "RESIZING", "SIGNALING", "STAGE_OUT"})
    if (state == active) return true;
  return false;
}

CommandResult Slurm::run(const std::vector<std::string>& command, const std::string& input) {
  ++requests_;
  return commands_.run(command, input, kTimeoutS, cancel_);
}

bool Slurm::may_be_starting(const CommandResult& refused) {
  const std::string said = refused.error + refused.output;
  if (said.find("Requested node configuration is not available") == std::string::npos) return false;
  if (!without_nodes_since_s_) without_nodes_since_s_ = wall_seconds();
  return wall_seconds() - *without_nodes_since_s_ < start_s_;
}

void Slurm::check(const std::vector<std::string>& options, double pause_s, Progress& progress) {
  // voxdag itself sets these options. With a user's values, voxdag would not find its tasks, or
  // they would build the wrong batches.
  for (const std::string& option : options)
    for (const std::string name :
         {"--array", "--job-name", "--comment", "--wrap", "--wait", "--parsable", "--test-only",
          "--clusters", "-a", "-J", "-W", "-M"})
      if (option == name || option.starts_with(name + "=") ||
          (name.size() == 2 && option.starts_with(name)))
        throw Error(ErrorCode::kInvalidInput,
                    option_text("cluster_options") + ": " + option +
                        " is set by voxdag: expected options such as --partition, --mem, --time "
                        "(" +
                        option_text("cluster_running") + " limits how many tasks run at a time)");
  // sbatch would take the first word that is not an option as a script, and the following words as
  // the script's arguments.
  for (size_t i = 0; i < options.size(); ++i) {
    const bool may_be_value = i > 0 && takes_next_word(options[i - 1]);
    if (!options[i].starts_with('-') && !may_be_value)
      throw Error(ErrorCode::kInvalidInput, option_text("cluster_options") + ": '" + options[i] +
                                                "': expected options, which begin with -");
  }
  std::vector<std::string> command{"sbatch", "--test-only"};
  command.insert(command.end(), options.begin(), options.end());
  CommandResult tested = run(command, "#!/bin/sh\nexit 0\n");
  for (bool is_first = true; tested.exit_status != 0 && may_be_starting(tested); is_first = false) {
    if (is_first)
      progress.warn("Slurm has no nodes for the tasks (" + trimmed(tested.error + tested.output) +
                    "): retrying, because Slurm may just have been started");
    std::this_thread::sleep_for(std::chrono::duration<double>(pause_s));
    cancel_.check();
    tested = run(command, "#!/bin/sh\nexit 0\n");
  }
  if (tested.exit_status == 127)
    throw Error(ErrorCode::kInvalidInput, option_text("cluster", "slurm") + ": " +
                                              trimmed(tested.error) +
                                              ": expected Slurm's commands on this machine");
  if (tested.exit_status != 0 && !is_unreachable(tested))
    throw Error(ErrorCode::kInvalidInput,
                "sbatch would refuse the tasks: " + trimmed(tested.error + tested.output) +
                    ": expected " + option_text("cluster_options") + " that sbatch accepts");
}

std::string Slurm::setting(const std::string& name) {
  if (!configuration_) {
    const CommandResult found = run({"scontrol", "show", "config"});
    if (found.exit_status != 0) return "";
    configuration_ = found.output;
  }
  for (const std::string& line : split(*configuration_, '\n')) {
    const size_t equals = line.find('=');
    if (equals != std::string::npos && trimmed(line.substr(0, equals)) == name)
      return trimmed(line.substr(line.find_first_not_of(' ', equals + 1)));
  }
  return "";
}

void Slurm::submit(const SlurmArrayRequest& request, std::map<uint32_t, SlurmTask>& tasks) {
  const uint32_t size =
      std::max<uint32_t>(number(setting("MaxArraySize")).value_or(kDefaultMaxArraySize), 1);
  std::map<uint32_t, std::vector<uint32_t>> arrays;  // key: batch of index 0; value: the indexes
  std::vector<uint32_t> batches = request.batches;
  std::ranges::sort(batches);
  for (const uint32_t batch : batches) arrays[batch / size * size].push_back(batch % size);
  const std::string line = script_line(request.command);
  std::vector<std::pair<uint32_t, std::vector<uint32_t>>> left(arrays.begin(), arrays.end());
  std::ranges::reverse(left);
  while (!left.empty()) {
    auto [first, indexes] = std::move(left.back());
    left.pop_back();
    std::vector<std::string> command{"sbatch", output_option(request.log_folder, "log-%A_%a.txt"),
                                     "--open-mode=append", "--requeue"};
    command.insert(command.end(), request.options.begin(), request.options.end());
    const std::string limit =
        request.max_running > 0 ? "%" + std::to_string(request.max_running) : "";
    command.insert(command.end(),
                   {"--parsable", "--job-name=" + request.name,
                    "--comment=" + std::to_string(first), "--array=" + ranges(indexes) + limit});
    const CommandResult submitted =
        run(command, line + " $((" + std::to_string(first) + " + SLURM_ARRAY_TASK_ID))\n");
    // The array exceeds a limit of Slurm, but it is possible that half of it does not. If Slurm has
    // already accepted some tasks of this request, accepted_job() throws Error{kIo} instead, and
    // the caller submits the remaining batches later.
    if (submitted.exit_status != 0 && is_too_much(submitted) && indexes.size() > 1 &&
        tasks.empty()) {
      const auto middle = indexes.begin() + static_cast<ptrdiff_t>(indexes.size() / 2);
      left.push_back({first, {middle, indexes.end()}});
      left.push_back({first, {indexes.begin(), middle}});
      continue;
    }
    const std::string job = accepted_job(submitted);
    for (const uint32_t index : indexes)
      tasks[first + index] = {.job = job,
                              .index = index,
                              .state = "PENDING",
                              .reason = "",
                              .node = "",
                              .first_batch = first};
  }
}

std::string Slurm::accepted_job(const CommandResult& submitted) {
  const std::string job = trimmed(submitted.output.substr(0, submitted.output.find(';')));
  if (!number(job))
    throw Error(is_unreachable(submitted) || is_too_much(submitted) || may_be_starting(submitted)
                    ? ErrorCode::kIo
                    : ErrorCode::kInvalidInput,
                "sbatch refused the job: " + trimmed(submitted.error + submitted.output) +
                    ": expected a job id (check " + option_text("cluster_options") + ")");
  without_nodes_since_s_.reset();
  return job;
}

std::string Slurm::submit_job(const SlurmJobRequest& request) {
  std::vector<std::string> command{"sbatch", output_option(request.log_folder, "log-%j.txt"),
                                   "--open-mode=append", "--requeue"};
  command.insert(command.end(), request.options.begin(), request.options.end());
  command.insert(command.end(),
                 {"--parsable", "--job-name=" + request.name, "--chdir=" + request.folder});
  std::string after;
  for (const std::string& job : request.after) after += ":" + job;
  if (!after.empty()) command.push_back("--dependency=afterany" + after);
  return accepted_job(run(command, script_line(request.command) + "\n"));
}

std::optional<std::vector<SlurmJob>> Slurm::jobs(const std::string& name) {
  const CommandResult listed =
      run({"squeue", "--noheader", "--all", "--name=" + name, "--format=%i|%T|%r"});
  if (listed.exit_status != 0) return std::nullopt;
  std::vector<SlurmJob> jobs;
  for (const std::string& line : split(listed.output, '\n'))
    if (const std::vector<std::string> fields = split(line, '|'); fields.size() == 3)
      jobs.push_back({fields[0], fields[1], trimmed(fields[2])});
  return jobs;
}

std::optional<std::vector<SlurmTask>> Slurm::active(const std::string& name) {
  const CommandResult listed = run(
      {"squeue", "--noheader", "--array", "--all", "--name=" + name, "--format=%F|%K|%T|%k|%N|%r"});
  if (listed.exit_status != 0) return std::nullopt;
  std::vector<SlurmTask> tasks;
  for (const std::string& line : split(listed.output, '\n')) {
    const std::vector<std::string> fields = split(line + "|", '|');
    if (fields.size() < 5) continue;
    const auto index = number(trimmed(fields[1])), first = number(trimmed(fields[3]));
    if (!index || !first) continue;
    tasks.push_back({.job = fields[0],
                     .index = *index,
                     .state = fields[2],
                     .reason = fields.size() > 5 ? trimmed(fields[5]) : "",
                     .node = trimmed(fields[4]),
                     .first_batch = *first});
  }
  return tasks;
}

std::optional<SlurmEnd> Slurm::end_of(const std::string& task) {
  SlurmEnd end;
  const CommandResult shown = run({"scontrol", "--oneliner", "show", "job", task});
  if (shown.exit_status != 0 && is_unreachable(shown)) return std::nullopt;
  if (shown.exit_status == 0) {
    end.state = field(shown.output, "JobState");
    end.reason = field(shown.output, "Reason");
    end.node = field(shown.output, "NodeList");
    end.exit_code = field(shown.output, "ExitCode");
  }
  const std::string accounting = setting("AccountingStorageType");
  if (!end.state.empty() || accounting.empty() || accounting.ends_with("none")) return end;
  const CommandResult accounted = run({"sacct", "--noheader", "--parsable2", "--allocations",
                                       "--jobs=" + task, "--format=State,NodeList,ExitCode"});
  const std::vector<std::string> fields =
      split(accounted.output.substr(0, accounted.output.find('\n')), '|');
  if (accounted.exit_status == 0 && fields.size() == 3)
    end = {.state = fields[0], .reason = "", .node = fields[1], .exit_code = trimmed(fields[2])};
  return end;
}

bool Slurm::cancel(const std::string& name) {
  return run({"scancel", "--name=" + name}).exit_status == 0;
}

bool Slurm::cancel_tasks(const std::vector<std::string>& tasks) {
  bool taken = true;
  for (size_t begin = 0; begin < tasks.size() && taken; begin += kMaxTasksOfCommand) {
    std::vector<std::string> command{"scancel"};
    const size_t end = std::min(begin + kMaxTasksOfCommand, tasks.size());
    command.insert(command.end(), tasks.begin() + static_cast<ptrdiff_t>(begin),
                   tasks.begin() + static_cast<ptrdiff_t>(end));
    taken = run(command).exit_status == 0;
  }
  return taken;
}

bool waits_for_its_turn(const std::string& reason) {
  for (const char* usual : {"", "None", "Priority", "Resources", "JobArrayTaskLimit", "BeginTime",
                            "Cleaning", "NodeDown", "Prolog", "Dependency"})
    if (reason == usual) return true;
  return false;
}

std::vector<std::string> split_words(const std::string& text) {
  std::vector<std::string> words;
  std::string word;
  bool in_word = false;
  char quote = 0;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '\\' && quote != '\'' && i + 1 < text.size()) {
      word += text[++i];
      in_word = true;
    } else if (quote != 0) {
      if (c == quote)
        quote = 0;
      else
        word += c;
    } else if (c == '"' || c == '\'') {
      quote = c;
      in_word = true;
    } else if (c == ' ' || c == '\t' || c == '\n') {
      if (in_word) words.push_back(word);
      word.clear();
      in_word = false;
    } else {
      word += c;
      in_word = true;
    }
  }
  if (quote != 0)
    throw Error(ErrorCode::kInvalidInput, "the options for sbatch '" + text +
                                              "': expected a closing " + std::string(1, quote));
  if (in_word) words.push_back(word);
  return words;
}

}  // namespace voxdag
