// The results of a job: its file, report, preview, log and subvolumes.
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "server/api/context.h"
#include "server/api/file_answer.h"
#include "server/api/problem.h"
#include "server/api/routes/router.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kMaxReportBytes = uint64_t{4} << 20;
constexpr uint64_t kDefaultLogBytes = 65536;
constexpr uint64_t kMaxLogBytes = uint64_t{1} << 20;

Job finished_job(Context& context, Call& call) {
  call.allow_query({});
  Job job = find_job(context.queue, call.names[0]);
  if (job.state != JobState::kSucceeded) {
    Problem problem = not_found("the job has no result: expected a succeeded job");
    problem.state = state_name(job.state);
    throw problem;
  }
  return job;
}

std::string read_range(ReadableFile& file, const ByteRange& range) {
  std::string bytes(range.size(), '\0');
  file.read_at(range.begin, std::as_writable_bytes(std::span(bytes)));
  return bytes;
}

std::string read_whole(FileSystem& files, const std::string& path) {
  const auto file = files.open_read(path);
  return read_range(*file, {0, file->size()});
}

// The name of the job or its first scene, reduced to characters that are safe in headers and
// shells.
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
  auto permit = context.transfers.acquire();
  if (!permit) throw busy("too many transfers", 5);
  FileAnswer answer;
  answer.file = context.files.open_read(context.dispatcher.folder(job.id).result());
  answer.type = "application/octet-stream";
  answer.sha256 = nlohmann::json::parse(job.result).at("sha256").get<std::string>();
  answer.name = file_name(job);
  Response response = answer_with_file(call.request, std::move(answer));
  if (response.file) {
    response.permit = std::move(permit);
    if (call.request.method == "GET")
      for (const FilePiece& piece : response.pieces)
        context.metrics.count_downloaded(piece.range.size());
  }
  return response;
}

Response get_report(Context& context, Call& call) {
  const Job job = finished_job(context, call);
  auto report = nlohmann::ordered_json::parse(
      read_small_file(context.files, context.dispatcher.folder(job.id).report(), kMaxReportBytes));
  report["output"] = file_name(job);
  return json_response(200, report.dump());
}

Response get_preview(Context& context, Call& call) {
  const Job job = finished_job(context, call);
  const std::string path = context.dispatcher.folder(job.id).preview();
  if (job.preview != Preview::kReady || !context.files.exists(path))
    throw not_found(job.preview == Preview::kFailed ? "the preview could not be rendered"
                                                    : "the preview is not rendered yet");
  Response response;
  response.headers.emplace("Content-Type", "image/png");
  response.headers.emplace("Cache-Control", "private, max-age=3600");
  response.body = read_whole(context.files, path);
  return response;
}

Response get_log(Context& context, Call& call) {
  call.allow_query({"max_bytes"});
  const uint64_t max_bytes = call.query_integer("max_bytes", kDefaultLogBytes, 1, kMaxLogBytes);
  const Job job = find_job(context.queue, call.names[0]);
  const std::string path = context.dispatcher.folder(job.id).log();
  Response response;
  response.headers.emplace("Content-Type", "text/plain; charset=utf-8");
  response.headers.emplace("Cache-Control", "no-store");
  if (!context.files.exists(path)) return response;
  const auto file = context.files.open_read(path);
  const uint64_t size = file->size(), begin = size - std::min(size, max_bytes);
  response.body = read_range(*file, {begin, size});
  if (begin > 0) response.body.erase(0, response.body.find('\n') + 1);
  return response;
}

Response get_subvolumes(Context& context, Call& call) {
  call.allow_query({});
  const Job job = find_job(context.queue, call.names[0]);
  const std::string path = context.dispatcher.folder(job.id).subvolumes();
  if (!context.files.exists(path)) throw not_found("the subvolumes of the job are not planned yet");
  return json_response(200, read_whole(context.files, path));
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
