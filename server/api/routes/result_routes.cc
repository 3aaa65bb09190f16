// What a job leaves: its file, report, picture, log and subvolumes.
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "server/api/context.h"
#include "server/api/file_answer.h"
#include "server/api/problem.h"
#include "server/api/routes/router.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kLargestReport = uint64_t{4} << 20;
constexpr uint64_t kStandardTail = 65536;
constexpr uint64_t kLongestTail = uint64_t{1} << 20;

Job finished_job(Context& context, Call& call) {
  call.allow_query({});
  Job job = find_job(context.queue, call.names[0]);
  if (job.state != JobState::kSucceeded) {
    Problem problem = not_found("the job has no result: expected one that succeeded");
    problem.state = state_name(job.state);
    throw problem;
  }
  return job;
}

// From the job's name, or its first scene's, with nothing in it that a header or shell minds.
std::string file_name(const Job& job) {
  const auto request = nlohmann::json::parse(job.request);
  std::string base = job.name;
  if (base.empty()) {
    base = request.at("scene").at(0).get<std::string>();
    base = base.substr(base.rfind('/') + 1);
    base = base.substr(0, base.rfind('.'));
  }
  for (char& c : base)
    if (!isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '_' && c != '-') c = '-';
  return base.substr(0, 100) + "-" + std::to_string(request.at("resolution").get<uint64_t>()) +
         ".vdag";
}

Response get_dag(Context& context, Call& call) {
  const Job job = finished_job(context, call);
  auto slot = context.transfers.take();
  if (!slot) throw busy("too many transfers at a time", 5);
  FileAnswer answer;
  answer.file = context.files.open_read(context.dispatcher.folder(job.id).result());
  answer.type = "application/octet-stream";
  answer.sha256 = nlohmann::json::parse(job.result).at("sha256").get<std::string>();
  answer.name = file_name(job);
  Response response = answer_with_file(call.request, std::move(answer));
  if (response.file) {
    response.slot = std::move(slot);
    if (call.request.method == "GET")
      for (const FilePiece& piece : response.pieces)
        context.metrics.count_downloaded(piece.range.size());
  }
  return response;
}

Response get_report(Context& context, Call& call) {
  const Job job = finished_job(context, call);
  auto report = nlohmann::ordered_json::parse(
      read_small_file(context.files, context.dispatcher.folder(job.id).report(), kLargestReport));
  report["output"] = file_name(job);
  return json_response(200, report.dump());
}

Response get_preview(Context& context, Call& call) {
  const Job job = finished_job(context, call);
  const std::string path = context.dispatcher.folder(job.id).preview();
  if (job.preview != Preview::kReady || !context.files.exists(path))
    throw not_found(job.preview == Preview::kFailed ? "no picture could be drawn"
                                                    : "the picture is not drawn yet");
  const auto file = context.files.open_read(path);
  Response response;
  response.headers.emplace("Content-Type", "image/png");
  response.headers.emplace("Cache-Control", "private, max-age=3600");
  response.body.resize(file->size());
  file->read_at(0, std::as_writable_bytes(std::span(response.body)));
  return response;
}

Response get_log(Context& context, Call& call) {
  call.allow_query({"bytes"});
  const uint64_t most = call.query_count("bytes", kStandardTail, 1, kLongestTail);
  const Job job = find_job(context.queue, call.names[0]);
  const std::string path = context.dispatcher.folder(job.id).log();
  Response response;
  response.headers.emplace("Content-Type", "text/plain; charset=utf-8");
  response.headers.emplace("Cache-Control", "no-store");
  if (!context.files.exists(path)) return response;
  const auto file = context.files.open_read(path);
  const uint64_t size = file->size(), begin = size - std::min(size, most);
  response.body.resize(size - begin);
  file->read_at(begin, std::as_writable_bytes(std::span(response.body)));
  if (begin > 0) response.body.erase(0, response.body.find('\n') + 1);
  return response;
}

Response get_subvolumes(Context& context, Call& call) {
  call.allow_query({});
  const Job job = find_job(context.queue, call.names[0]);
  const std::string path = context.dispatcher.folder(job.id).subvolumes();
  if (!context.files.exists(path)) throw not_found("the job's subvolumes are not planned yet");
  const auto file = context.files.open_read(path);
  Response response = json_response(200, "");
  response.body.resize(file->size());
  file->read_at(0, std::as_writable_bytes(std::span(response.body)));
  return response;
}

}  // namespace

void add_result_routes(Router& router, Context& context) {
  using Get = Response (*)(Context&, Call&);
  const std::pair<const char*, Get> routes[] = {{"dag", get_dag},
                                                {"report", get_report},
                                                {"preview.png", get_preview},
                                                {"log", get_log},
                                                {"subvolumes", get_subvolumes}};
  for (const auto& [name, get] : routes)
    router.add("GET", std::string("/api/v1/jobs/{id}/") + name, Role::kRead,
               [&context, get = get](Call& call) { return get(context, call); });
}

}  // namespace voxdag::server
