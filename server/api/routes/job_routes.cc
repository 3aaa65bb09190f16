// Jobs: submitting, listing, showing and controlling them.
#include <charconv>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "server/api/context.h"
#include "server/api/dry_run.h"
#include "server/api/job_json.h"
#include "server/api/problem.h"
#include "server/api/routes/router.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxListed = 200;
constexpr size_t kMaxKeyChars = 255;

std::string to_json(Context& context, const Job& job) {
  const auto live = context.dispatcher.live(job.id);
  uint64_t position = 0;
  if (job.state == JobState::kQueued) {
    const auto positions = context.queue.places();
    const auto found = positions->find(job.number);
    if (found != positions->end()) position = found->second;
  }
  return job_json(job, live.get(), position, context.config.jobs.max_attempts);
}

IdempotencyKey key_of(const Request& request, const JobRequest& job) {
  const auto given = request.headers.find("Idempotency-Key");
  if (given == request.headers.end()) return {};
  const std::string& key = given->second;
  bool visible = !key.empty() && key.size() <= kMaxKeyChars;
  for (const char c : key) visible = visible && c > 0x20 && c < 0x7f;
  if (!visible) throw bad_request("Idempotency-Key: expected 1 to 255 visible ASCII characters");
  return {key, sha256_hex(job.text + '\n' + std::to_string(job.priority) + '\n' + job.name)};
}

Response accepted(Context& context, const Job& job, bool replayed) {
  Response response = json_response(202, to_json(context, job));
  response.headers.emplace("Location", "/api/v1/jobs/" + job.id);
  if (replayed) response.headers.emplace("Idempotent-Replayed", "true");
  return response;
}

Response post_job(Context& context, Call& call) {
  call.allow_query({"dry_run"});
  const std::string dry = call.query("dry_run");
  if (call.request.target.query.contains("dry_run") && dry != "true" && dry != "false")
    throw bad_request("'dry_run': expected true or false");
  const JobRequest request =
      parse_job_request(read_json_body(call.request, context.config.transfers.max_body_bytes));
  const IdempotencyKey key = key_of(call.request, request);
  if (dry == "true") return dry_run(context, request);
  if (context.draining) throw busy("the service is stopping");
  std::lock_guard lock(context.scene_mutex);
  if (const auto known = context.queue.find_by_key(key)) return accepted(context, *known, true);
  context.tasks.make(request, Task::Kind::kBuild);  // throws if the request cannot be built
  Job job;
  job.name = request.name;
  job.request = request.text;
  job.scenes = TaskResolver::uploads_of(request);
  job.posted_by = call.caller.name;
  job.priority = request.priority;
  const JobQueue::Added added = context.queue.add(job, key, context.config.jobs.max_queued);
  return accepted(context, added.job, added.replayed);
}

JobFilter filter_of(const Call& call) {
  call.allow_query({"state", "limit", "cursor"});
  JobFilter filter;
  filter.limit = call.query_integer("limit", filter.limit, 1, kMaxListed);
  filter.before =
      static_cast<int64_t>(call.query_integer("cursor", INT64_MAX, 1, uint64_t{INT64_MAX}));
  if (!call.request.target.query.contains("state")) return filter;
  const std::string states = call.query("state");
  for (size_t begin = 0; begin <= states.size();) {
    const size_t end = std::min(states.find(',', begin), states.size());
    const auto state = parse_state(std::string_view(states).substr(begin, end - begin));
    if (!state) throw bad_request("'state': expected a comma-separated list of job states");
    filter.states.push_back(*state);
    begin = end + 1;
  }
  return filter;
}

Response list_jobs(Context& context, Call& call) {
  JobFilter filter = filter_of(call);
  const size_t limit = filter.limit++;  // one more shows whether there is a next page
  std::vector<Job> jobs = context.queue.list(filter);
  std::string next = "null";
  if (jobs.size() > limit) {
    jobs.resize(limit);
    next = '"' + std::to_string(jobs.back().number) + '"';
  }
  std::string body = "{\"jobs\":[";
  for (const Job& job : jobs) body += (&job == &jobs.front() ? "" : ",") + to_json(context, job);
  body += "],\"next_cursor\":" + next + ",\"counts\":{";
  const auto counts = context.queue.counts();
  for (size_t i = 0; i < kJobStateNames.size(); ++i) {
    const auto found = counts.find(static_cast<JobState>(i));
    body += (i ? ",\"" : "\"") + std::string(kJobStateNames[i]) +
            "\":" + std::to_string(found == counts.end() ? 0 : found->second);
  }
  return json_response(200, body + "}}");
}

Response patch_job(Context& context, Call& call) {
  call.allow_query({});
  const auto body = nlohmann::json::parse(
      read_json_body(call.request, context.config.transfers.max_body_bytes), nullptr, false);
  if (!body.is_object() || body.size() != 1 || !body.contains("priority"))
    throw bad_request("expected {\"priority\": N}");
  const int priority = parse_priority(body["priority"].dump());
  const Job job = context.queue.change(call.names[0], [&](Job& j) { j.priority = priority; });
  return json_response(200, to_json(context, job));
}

using Action = Job (Dispatcher::*)(const std::string& id);

Response act(Context& context, Call& call, Action action) {
  call.allow_query({});
  expect_no_body(call.request);
  return json_response(202, to_json(context, (context.dispatcher.*action)(call.names[0])));
}

}  // namespace

Job find_job(JobQueue& queue, const std::string& id) {
  auto job = queue.find(id);
  if (!job) throw not_found("no such job: expected the id of a job that was not deleted");
  return std::move(*job);
}

void add_job_routes(Router& router, Context& context) {
  router.add("POST", "/api/v1/jobs", Role::kSubmit,
             [&](Call& call) { return post_job(context, call); });
  router.add("GET", "/api/v1/jobs", Role::kRead,
             [&](Call& call) { return list_jobs(context, call); });
  router.add("GET", "/api/v1/jobs/{id}", Role::kRead, [&](Call& call) {
    call.allow_query({});
    return json_response(200, to_json(context, find_job(context.queue, call.names[0])));
  });
  router.add("PATCH", "/api/v1/jobs/{id}", Role::kAdmin,
             [&](Call& call) { return patch_job(context, call); });
  router.add("DELETE", "/api/v1/jobs/{id}", Role::kAdmin, [&](Call& call) {
    call.allow_query({});
    expect_no_body(call.request);
    context.dispatcher.remove(call.names[0]);
    Response response;
    response.status = 204;
    return response;
  });
  const std::pair<const char*, Action> actions[] = {{"cancel", &Dispatcher::cancel},
                                                    {"suspend", &Dispatcher::suspend},
                                                    {"resume", &Dispatcher::resume},
                                                    {"retry", &Dispatcher::retry}};
  for (const auto& [name, action] : actions)
    router.add("POST", std::string("/api/v1/jobs/{id}/") + name, Role::kSubmit,
               [&context, action = action](Call& call) { return act(context, call, action); });
}

}  // namespace voxdag::server
