// Jobs: submitting, listing, showing and controlling them.
#include <charconv>
#include <nlohmann/json.hpp>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/format/checksum.h"
#include "core/io/random_id.h"
#include "scene/messages.h"
#include "server/api/answers/job_json.h"
#include "server/api/answers/public_problem.h"
#include "server/api/context/context.h"
#include "server/api/routes/routes.h"
#include "server/base/printable_json.h"
#include "server/disk/data_folder.h"
#include "server/jobs/process/child_process.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxKeyChars = 255;
// A page of jobs ends with the job that brings its size to at least this number of bytes.
constexpr size_t kMaxPageBytes = 512 << 10;
constexpr size_t kJobsPerRead = 16;
// Maximum size of a stored request. The service keeps the request as long as the job, and includes
// it in every answer about the job.
constexpr size_t kMaxRequestBytes = 32 << 10;
constexpr const char* kJobs = "/api/v1/jobs";
constexpr const char* kJob = "/api/v1/jobs/{id}";

const Parameter kDryRun = {"dry_run", "return an estimate instead of queuing the job",
                           "^(true|false)$"};
const Parameter kIdempotencyKey = {
    "Idempotency-Key", "a request with a known key returns the same job", "^[!-~]{0,255}$"};
const Parameter kLocation = {"Location", "URL of the job"};
const Parameter kReplayed = {"Idempotent-Replayed", "true if the key was used before"};
const Parameter kJobLimit = {"limit", "maximum number of entries", "", IntegerRange{1, 200, 50}};
const Parameter kJobCursor = {"cursor", "next_cursor of the previous page", "",
                              IntegerRange{1, INT64_MAX, INT64_MAX}};
// The characters of is_printable() (core/base/text/printable.h), as a regular expression.
const std::string kPrintable =
    R"([^\u0000-\u001F\u007F-\u009F\u061C\u200E\u200F\u2028-\u202E\u2066-\u2069])";
const Parameter kJobWords = {
    "q", "text in the name, the scenes or the labels, or at the beginning of the id",
    "^" + kPrintable + "{0,100}$"};
const Parameter kJobLabel = {"label", "a label of the jobs", "^" + kPrintable + "{0,64}$"};
constexpr size_t kMaxSearchBytes = 400;  // 100 characters
const Parameter kJobStates = {"state", "comma-separated list of states", [] {
                                std::string states = kJobStateNames[0];
                                for (size_t i = 1; i < kJobStateNames.size(); ++i)
                                  states += std::string("|") + kJobStateNames[i];
                                return "^(" + states + ")(,(" + states + "))*$";
                              }()};

std::string to_json(Context& context, const Job& job) {
  const auto live = context.dispatcher.live(job.id);
  uint64_t position = 0;
  if (job.state == JobState::kQueued) {
    const auto positions = context.queue.places();
    const auto found = positions->find(job.number);
    if (found != positions->end()) position = found->second;
  }
  return job_json(job, live.get(), position, context.config.jobs.max_attempts,
                  context.webhooks.job_member(job));
}

IdempotencyKey key_of(const Request& request, const JobRequest& job) {
  const auto given = request.headers.find("Idempotency-Key");
  if (given == request.headers.end()) return {};
  const std::string& key = given->second;
  bool visible = !key.empty() && key.size() <= kMaxKeyChars;
  for (const char c : key) visible = visible && c > 0x20 && c < 0x7f;
  if (!visible)
    throw bad_request("Idempotency-Key '" + printable(key) + "' of " + std::to_string(key.size()) +
                      " bytes: expected 1 to 255 visible ASCII characters");
  return {key, sha256_hex(job.text + '\n' + std::to_string(job.priority) + '\n' + job.name)};
}

// Waits for a permit to build an answer. Then calls get() and returns an answer with the job that
// get() returns.
template <class Get>
Response job_response_of(Context& context, int status, const Get& get) {
  auto permit = context.answers.wait();
  Response response = json_response(status, to_json(context, get()));
  response.build_permit = std::move(permit);
  return response;
}

Response job_response(Context& context, int status, const Job& job) {
  return job_response_of(context, status, [&]() -> const Job& { return job; });
}

Response accepted(Context& context, const Job& job, bool replayed) {
  Response response = job_response(context, 202, job);
  response.headers.emplace("Location", "/api/v1/jobs/" + job.id);
  if (replayed) response.headers.emplace("Idempotent-Replayed", "true");
  return response;
}

// The folder of a dry run (plan). The destructor removes it.
class TemporaryTask {
 public:
  TemporaryTask(FileSystem& files, const std::string& path) : folder{path}, files_(files) {
    files_.make_directories(path);
  }
  ~TemporaryTask() {
    try {
      remove_tree(files_, folder.path);
    } catch (const std::exception&) {
      // The service removes the remaining folder when it starts the next time.
    }
  }
  const JobFolder folder;

 private:
  FileSystem& files_;
};

// The task of a dry run. Requests cannot remove the task's scenes during the lifetime of this
// object.
class Plan {
 public:
  Plan(Context& context, const JobRequest& request)
      : context_(context), scenes_(TaskResolver::uploads_of(request)) {
    std::lock_guard lock(context_.scene_mutex);
    task = context_.tasks.make(request, JobTask::Kind::kPlan);
    context_.planned_scenes.insert(scenes_.begin(), scenes_.end());
  }
  ~Plan() {
    std::lock_guard lock(context_.scene_mutex);
    for (const std::string& scene : scenes_)
      context_.planned_scenes.erase(context_.planned_scenes.find(scene));
  }
  Plan(const Plan&) = delete;
  JobTask task;

 private:
  Context& context_;
  const std::vector<std::string> scenes_;
};

Problem problem_of(const Failure& failure) {
  const auto code = error_code_named(failure.code);
  if (code && *code != ErrorCode::kCanceled) return problem(*code, failure.text);
  return Problem(500, "internal",
                 "the plan failed with the error " + failure.code +
                     ": expected an estimate; send the request again, and report the defect if it "
                     "fails again");
}

// Returns the estimate of a job without queuing it: runs the plan in a child process. Throws
// Problem: the error of the scene or the request; 503 if too many plans are running, the service is
// stopping, or the plan takes longer than plan_timeout_s.
Response dry_run(Context& context, Call& call, const JobRequest& request) {
  const auto permit = context.plans.acquire(call.caller.client);
  if (!permit) throw busy("too many concurrent plans: " + context.plans.limits(), 5);
  const Plan plan(context, request);
  const TemporaryTask temporary(context.files,
                                context.config.data_folder + "/plans/" + random_id());
  write_task(context.files, temporary.folder.task(), plan.task);
  ChildProcess child({{context.config.program, "run-job", temporary.folder.path},
                      temporary.folder.log(),
                      context.config.jobs.nice});
  std::string estimate;
  std::optional<Failure> failure;
  const double deadline = wall_seconds() + context.config.jobs.plan_timeout_s;
  const auto must_stop = [&] {
    return context.draining || wall_seconds() > deadline || call.request.client_has_left();
  };
  bool killed = false;
  child.read_lines(
      [&](std::string_view line) {
        const auto message = decode(line);
        if (!message) return;
        if (const auto* result = std::get_if<Result>(&*message)) estimate = result->json;
        if (const auto* reported = std::get_if<Failure>(&*message)) failure = *reported;
      },
      [&] { return killed = killed || must_stop(); });
  child.wait();
  if (killed && context.draining)
    throw busy("the service is stopping: expected a request after its restart");
  if (killed && wall_seconds() <= deadline)
    throw bad_request("the client has closed the connection: expected it to wait for the estimate");
  if (killed)
    throw busy("the plan took longer than its limit of " +
                   duration_text(context.config.jobs.plan_timeout_s) +
                   ": expected a smaller scene, or a larger jobs.plan_timeout_s",
               60);
  if (failure) throw problem_of(*failure);
  if (estimate.empty())
    throw Problem(500, "internal",
                  "the process that makes the plan ended without a result: send the request again, "
                  "and report the defect if it fails again");
  return json_response(200, printable_json_text(estimate));
}

JobRequest read_job_request(Context& context, Call& call) {
  const std::string body = read_json_body(call.request, context.config.transfers.max_body_bytes);
  const auto permit = context.answers.wait();  // parsed JSON takes several times its text's memory
  JobRequest request = parse_job_request(body);
  if (request.text.size() > kMaxRequestBytes)
    throw bad_request("scene, resolution, options, labels and webhook have " +
                      std::to_string(request.text.size()) + " bytes as JSON: expected at most " +
                      std::to_string(kMaxRequestBytes));
  if (!request.webhook.empty()) context.webhooks.check(request.webhook);
  return request;
}

Response post_job(Context& context, Call& call) {
  const std::string dry = call.query("dry_run");
  if (call.request.target.query.contains("dry_run") && dry != "true" && dry != "false")
    throw bad_request("'dry_run' is '" + printable(dry) + "': expected true or false");
  const JobRequest request = read_job_request(context, call);
  const IdempotencyKey key = key_of(call.request, request);
  if (dry == "true") return dry_run(context, call, request);
  if (context.draining) throw busy("the service is stopping: expected a request after its restart");
  std::lock_guard lock(context.scene_mutex);
  if (const auto known = context.queue.find_by_key(key)) return accepted(context, *known, true);
  context.tasks.make(request, JobTask::Kind::kBuild);  // throws if the requested build is invalid
  Job job;
  job.name = request.name;
  job.request = request.text;
  job.scenes = TaskResolver::uploads_of(request);
  job.posted_by = call.caller.name;
  job.priority = request.priority;
  const JobQueue::Added added = context.queue.add(job, key, context.config.jobs.max_queued);
  return accepted(context, added.job, added.replayed);
}

std::string search_text(const Call& call, const Parameter& parameter) {
  const std::string text = call.query(parameter.name);
  if (text.size() > kMaxSearchBytes || !is_printable(text))
    throw bad_request("'" + parameter.name + "' is '" + printable(text) +
                      "': expected at most 100 printable characters");
  return text;
}

JobFilter filter_of(const Call& call) {
  JobFilter filter;
  filter.limit = call.query_integer(kJobLimit);
  filter.before = static_cast<int64_t>(call.query_integer(kJobCursor));
  filter.words = search_text(call, kJobWords);
  filter.label = search_text(call, kJobLabel);
  if (!call.request.target.query.contains("state")) return filter;
  const std::string states = call.query("state");
  for (size_t begin = 0; begin <= states.size();) {
    const size_t end = std::min(states.find(',', begin), states.size());
    const auto state = parse_state(std::string_view(states).substr(begin, end - begin));
    if (!state)
      throw bad_request("'state' is '" + printable(states) +
                        "': expected a comma-separated list of queued, running, suspended, "
                        "canceling, canceled, failed and succeeded");
    filter.states.push_back(*state);
    begin = end + 1;
  }
  return filter;
}

// Adds the jobs of a page to `body`: up to filter.limit jobs, or fewer if the page reaches
// kMaxPageBytes first. Reads a few jobs at a time. Returns the value of next_cursor as JSON.
std::string add_page(Context& context, JobFilter filter, std::string& body) {
  size_t missing = filter.limit;
  bool more = true;
  for (const char* separator = ""; more && missing > 0 && body.size() < kMaxPageBytes;) {
    filter.limit = std::min(missing, kJobsPerRead) + 1;  // one more, to find out if others follow
    std::vector<Job> jobs = context.queue.list(filter);
    more = jobs.size() == filter.limit;
    if (more) jobs.pop_back();
    for (const Job& job : jobs) {
      if (body.size() >= kMaxPageBytes) return '"' + std::to_string(filter.before) + '"';
      body += separator + to_json(context, job);
      separator = ",";
      filter.before = job.number;
      --missing;
    }
  }
  return more ? '"' + std::to_string(filter.before) + '"' : "null";
}

Response list_jobs(Context& context, Call& call) {
  auto permit = context.answers.wait();
  std::string body = "{\"jobs\":[";
  const std::string next = add_page(context, filter_of(call), body);
  body += "],\"next_cursor\":" + next + ",\"counts\":{";
  const auto counts = context.queue.counts();
  for (size_t i = 0; i < kJobStateNames.size(); ++i) {
    const auto found = counts.find(static_cast<JobState>(i));
    body += (i ? ",\"" : "\"") + std::string(kJobStateNames[i]) +
            "\":" + std::to_string(found == counts.end() ? 0 : found->second);
  }
  Response response = json_response(200, std::move(body += "}}"));
  response.build_permit = std::move(permit);
  return response;
}

Response get_job(Context& context, Call& call) {
  return job_response_of(context, 200, [&] { return find_job(context.queue, call.names[0]); });
}

Response patch_job(Context& context, Call& call) {
  const JobPatch patch =
      parse_job_patch(read_json_body(call.request, context.config.transfers.max_body_bytes));
  const Job job = context.queue.change(call.names[0], [&](Job& j) { j.priority = patch.priority; });
  return job_response(context, 200, job);
}

Response delete_job(Context& context, Call& call) {
  expect_no_body(call.request);
  const std::string result = context.dispatcher.folder(call.names[0]).result();
  context.open_sources.close(result);
  context.dispatcher.remove(call.names[0]);
  // Closes the file again, because a request for a tile may have opened it between the first
  // close() and the removal.
  context.open_sources.close(result);
  context.partial.close(call.names[0]);
  return no_content();
}

// Queues a failed or canceled job again. Refuses a job whose scenes were deleted, as post_job()
// does.
Response retry_job(Context& context, Call& call) {
  expect_no_body(call.request);
  std::lock_guard lock(context.scene_mutex);
  const Job job = find_job(context.queue, call.names[0]);
  if (job.state == JobState::kFailed || job.state == JobState::kCanceled)
    context.tasks.make(parse_job_request(job.request), JobTask::Kind::kBuild);
  const Job queued = context.dispatcher.retry(job.id);
  // Forgets the partial view, because the job's scene can have been replaced since the last
  // attempt.
  if (has_ended(job.state)) context.partial.close(job.id);
  return job_response(context, 202, queued);
}

// Returns a handler that applies the action to a job.
Router::Handler act(Job (Dispatcher::*action)(const std::string& id)) {
  return [action](Context& context, Call& call) {
    expect_no_body(call.request);
    return job_response(context, 202, (context.dispatcher.*action)(call.names[0]));
  };
}

// Returns a handler that calls `handler`, for requests that free disk space. If the queue cannot
// record the change because the disk is full, frees the ballast (disk_space.h) and calls `handler`
// again.
Router::Handler freeing_space(Router::Handler handler) {
  return [handler = std::move(handler)](Context& context, Call& call) {
    return context.disk.with_ballast([&] { return handler(context, call); });
  };
}

void add_list_routes(Router& router) {
  router.add({.method = "POST",
              .pattern = kJobs,
              .role = Role::kSubmit,
              .id = "postJob",
              .summary = "Queue a build, or estimate one",
              .tag = "jobs",
              .query = {kDryRun},
              .headers = {kIdempotencyKey},
              .body = json_content("JobRequest"),
              .answers = {{200, "the estimate of a dry run", {json_content("Plan")}},
                          {202, "the queued job", {json_content("Job")}, {kLocation, kReplayed}}},
              .problems = {404, 408, 409, 413, 415, 422}},
             post_job);
  router.add({.method = "GET",
              .pattern = kJobs,
              .id = "listJobs",
              .summary = "Jobs, newest first",
              .tag = "jobs",
              .query = {kJobStates, kJobWords, kJobLabel, kJobLimit, kJobCursor},
              .answers = {{200,
                           "a page of jobs; it has fewer than limit if they are long",
                           {json_content("JobList")}}}},
             list_jobs);
}

void add_one_job_routes(Router& router) {
  router.add({.method = "GET",
              .pattern = kJob,
              .id = "getJob",
              .summary = "One job",
              .tag = "jobs",
              .answers = {{200, "the job", {json_content("Job")}}},
              .problems = {404}},
             get_job);
  router.add({.method = "PATCH",
              .pattern = kJob,
              .role = Role::kAdmin,
              .id = "patchJob",
              .summary = "Change a job's priority",
              .tag = "jobs",
              .body = json_content("JobPatch"),
              .answers = {{200, "the job", {json_content("Job")}}},
              .problems = {404, 408, 413, 415}},
             patch_job);
  router.add({.method = "DELETE",
              .pattern = kJob,
              .role = Role::kAdmin,
              .id = "deleteJob",
              .summary = "Delete an ended job and its files",
              .tag = "jobs",
              .answers = {{204, "deleted"}},
              .problems = {404, 409}},
             freeing_space(delete_job));
}

void add_action_routes(Router& router) {
  const auto add_action = [&](const std::string& name, const std::string& summary, auto handler) {
    router.add({.method = "POST",
                .pattern = std::string(kJob) + '/' + name,
                .role = Role::kSubmit,
                .id = name + "Job",
                .summary = summary,
                .tag = "jobs",
                .answers = {{202, "the job", {json_content("Job")}}},
                .problems = {404, 409}},
               Router::Handler(std::move(handler)));
  };
  add_action("cancel", "Cancel a job", freeing_space(act(&Dispatcher::cancel)));
  add_action("suspend", "Suspend a job at its next checkpoint", act(&Dispatcher::suspend));
  add_action("resume", "Resume a suspended job", act(&Dispatcher::resume));
  add_action("retry", "Retry a failed or canceled job", retry_job);
}

}  // namespace

Job find_job(JobQueue& queue, const std::string& id) {
  auto job = queue.find(id);
  if (!job)
    throw not_found("no such job: '" + printable(id) + "': expected the id of an existing job");
  return std::move(*job);
}

void add_job_routes(Router& router) {
  add_list_routes(router);
  add_one_job_routes(router);
  add_action_routes(router);
}

}  // namespace voxdag::server
