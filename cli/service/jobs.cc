#include <cstdio>
#include <string>
#include <vector>

#include "cli/output.h"
#include "cli/service/job_text.h"
#include "cli/service/service_options.h"
#include "cli/service/table_text.h"
#include "core/base/clock.h"
#include "core/base/text/percent.h"
#include "core/base/text/printable.h"
#include "core/fields/json_text.h"

namespace voxdag::cli {
namespace {

struct JobsCommand {
  ServiceOptions service;
  std::string states, label, words;
  unsigned limit = 50;
  bool json = false;
};

void print(const Json& answer) {
  const double now_s = unix_seconds();
  std::vector<std::vector<std::string>> rows = {
      {"ID", "STATE", "AGE", "RESOLUTION", "PROGRESS", "NAME"}};
  for (const Json& job : answer.at("jobs"))
    rows.push_back({printable_line(job.at("id").get<std::string>()),
                    printable_line(job.at("state").get<std::string>()),
                    age_text(job.at("created_at").get<std::string>(), now_s),
                    exact_json_text(job.at("resolution")), progress_text(job),
                    job_title(job) + labels_text(job)});
  // On a terminal, each job has one line.
  for (const std::string& line : table_lines(rows, "llrrll", terminal_columns()))
    std::printf("%s\n", line.c_str());
  if (!answer.at("next_cursor").is_null()) std::printf("(more: raise --limit)\n");
}

// Returns up to command.limit jobs as one JSON object, in the form of a page of jobs (docs/api.md).
// A page from the service can have fewer jobs than its limit, so this function may request several
// pages and join them.
Json get_jobs(const JobsCommand& command, ServiceClient& service) {
  const auto page = [&](size_t limit, const std::string& cursor) {
    std::string path = "/api/v1/jobs?limit=" + std::to_string(limit) + cursor;
    if (!command.states.empty()) path += "&state=" + command.states;
    if (!command.label.empty()) path += "&label=" + percent_encoded(command.label);
    if (!command.words.empty()) path += "&q=" + percent_encoded(command.words);
    return service.get(path);
  };
  Json answer = page(command.limit, "");
  Json& jobs = answer.at("jobs");
  while (answer.at("next_cursor").is_string() && jobs.size() < command.limit) {
    const Json next =
        page(command.limit - jobs.size(), "&cursor=" + answer.at("next_cursor").get<std::string>());
    if (next.at("jobs").empty()) break;
    jobs.insert(jobs.end(), next.at("jobs").begin(), next.at("jobs").end());
    answer["next_cursor"] = next.at("next_cursor");
  }
  return answer;
}

void run(const JobsCommand& command, ServiceClient& service, CommandContext&) {
  const Json answer = get_jobs(command, service);
  if (command.json)
    print_json(answer);
  else
    print(answer);
}

// Returns "" if `states` has only lowercase letters and commas, which need no escape in a URL.
// Otherwise returns an error message. The server checks whether the states exist.
std::string check_states(const std::string& states) {
  const bool fine = states.find_first_not_of("abcdefghijklmnopqrstuvwxyz,") == std::string::npos;
  return fine ? "" : "'" + states + "': expected states such as running,queued";
}

void declare(Command& command, JobsCommand& state) {
  state.service.declare(command);
  command
      .option("--state", state.states,
              "only jobs in these states: names out of queued, running, suspended, canceling, "
              "canceled, failed, succeeded")
      .check(check_states);
  command.option("--label", state.label, "only jobs that have exactly this label");
  command.option("--find", state.words,
                 "only jobs whose name, scenes or labels contain this text, or whose id begins "
                 "with it");
  command.option("--limit", state.limit, "maximum number of jobs, 1 to 200 (default 50)")
      .range(1, 200);
  command.json_flag(state.json, "one JSON object on standard output");
}

}  // namespace

void add_jobs_command(CommandLine& line) {
  add_service_command<JobsCommand>(line, "jobs", "list the jobs of a server, newest first");
}

}  // namespace voxdag::cli
