// The results of a job: its file, report, preview, log and subvolumes.
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/io/random_id.h"
#include "server/api/context.h"
#include "server/api/public_problem.h"
#include "server/api/routes/router.h"
#include "server/http/digest_field.h"

namespace voxdag::server {
namespace {

constexpr const char* kDagType = "application/octet-stream";
// Of what is sent at once: reports, previews and lists of subvolumes.
constexpr uint64_t kMaxResultBytes = uint64_t{1} << 30;
constexpr uint64_t kDefaultLogBytes = 65536;
constexpr uint64_t kMaxLogBytes = uint64_t{1} << 20;

Job finished_job(Context& context, Call& call) {
  Job job = find_job(context.queue, call.names[0]);
  if (job.state != JobState::kSucceeded) {
    Problem problem = not_found("the job has no result: expected a succeeded job");
    problem.state = state_name(job.state);
    throw problem;
  }
  return job;
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

std::string content_range(const ByteRange& range, uint64_t size) {
  return "bytes " + std::to_string(range.begin) + "-" + std::to_string(range.end - 1) + "/" +
         std::to_string(size);
}

RangeAnswer requested_ranges(const Request& request, const std::string& tag, uint64_t size) {
  const auto condition = request.headers.find("If-Range");
  // An entity tag that differs, or a date, makes the answer the whole file.
  if (condition != request.headers.end() && trimmed(condition->second) != tag) return {};
  // Only GET has ranges (RFC 9110, 14.2).
  return request.method == "GET" ? parse_ranges(request.header("Range"), size) : RangeAnswer{};
}

void add_multipart(Response& response, const std::vector<ByteRange>& ranges, uint64_t size) {
  const std::string boundary = random_id() + random_id();
  for (const ByteRange& range : ranges)
    response.pieces.push_back({"\r\n--" + boundary + "\r\nContent-Type: " + kDagType +
                                   "\r\nContent-Range: " + content_range(range, size) + "\r\n\r\n",
                               range});
  response.pieces.push_back({"\r\n--" + boundary + "--\r\n", {}});
  response.headers.emplace("Content-Type", "multipart/byteranges; boundary=" + boundary);
}

// A large file, which must not be empty: whole, one range or several (RFC 9110, sections 13 and
// 14), as 200, 206 or 304. Its SHA-256 in hex is its ETag. Throws Problem (416).
Response answer_with_file(const Request& request, std::shared_ptr<ReadableFile> file,
                          const std::string& sha256, const std::string& name) {
  const uint64_t size = file->size();
  const std::string tag = '"' + sha256 + '"';
  Response response;
  response.headers.emplace("ETag", tag);
  response.headers.emplace("Accept-Ranges", "bytes");
  response.headers.emplace("Cache-Control", "private, no-cache");
  if (has_tag(request.header("If-None-Match"), tag)) {
    response.status = 304;
    return response;
  }
  const RangeAnswer requested = requested_ranges(request, tag, size);
  if (requested.kind == RangeAnswer::Kind::kUnsatisfiable) {
    Problem problem(416, "range_not_satisfiable", "no requested range lies within the file");
    problem.headers.emplace("Content-Range", "bytes */" + std::to_string(size));
    throw problem;
  }
  response.headers.emplace("Content-Disposition", "attachment; filename=\"" + name + '"');
  response.headers.emplace("Repr-Digest", digest_field(sha256));
  if (requested.kind == RangeAnswer::Kind::kPart) {
    response.status = 206;
    if (requested.ranges.size() == 1) {
      response.headers.emplace("Content-Range", content_range(requested.ranges[0], size));
      response.headers.emplace("Content-Type", kDagType);
      response.pieces.push_back({"", requested.ranges[0]});
    } else {
      add_multipart(response, requested.ranges, size);
    }
  } else {
    response.headers.emplace("Content-Type", kDagType);
    response.pieces.push_back({"", {0, size}});
  }
  response.file = std::move(file);
  return response;
}

Response get_dag(Context& context, Call& call) {
  const Job job = finished_job(context, call);
  auto permit = context.downloads.acquire(call.caller.client);
  if (!permit) throw busy("too many downloads, of this client or of all", 5);
  Response response = answer_with_file(
      call.request, context.files.open_read(context.dispatcher.folder(job.id).result()),
      nlohmann::json::parse(job.result).at("sha256"), file_name(job));
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
      read_small_file(context.files, context.dispatcher.folder(job.id).report(), kMaxResultBytes));
  report["output"] = file_name(job);
  return json_response(200, report.dump());
}

Response get_preview(Context& context, Call& call) {
  const Job job = finished_job(context, call);
  const std::string path = context.dispatcher.folder(job.id).preview();
  if (job.preview != Preview::kReady || !context.files.exists(path))
    throw not_found(job.preview == Preview::kFailed ? "the preview could not be rendered"
                                                    : "the preview is not rendered yet");
  return make_response(200, "image/png", "private, max-age=3600",
                       read_small_file(context.files, path, kMaxResultBytes));
}

Response get_log(Context& context, Call& call) {
  const uint64_t max_bytes = call.query_integer("max_bytes", kDefaultLogBytes, 1, kMaxLogBytes);
  const Job job = find_job(context.queue, call.names[0]);
  const std::string path = context.dispatcher.folder(job.id).log();
  Response response = make_response(200, "text/plain; charset=utf-8", "no-store");
  if (!context.files.exists(path)) return response;
  const auto file = context.files.open_read(path);
  const uint64_t size = file->size(), begin = size - std::min(size, max_bytes);
  response.body.resize(size - begin);
  file->read_at(begin, std::as_writable_bytes(std::span(response.body)));
  if (begin > 0) response.body.erase(0, response.body.find('\n') + 1);
  return response;
}

Response get_subvolumes(Context& context, Call& call) {
  const Job job = find_job(context.queue, call.names[0]);
  const std::string path = context.dispatcher.folder(job.id).subvolumes();
  if (!context.files.exists(path)) throw not_found("the subvolumes of the job are not planned yet");
  return json_response(200, read_small_file(context.files, path, kMaxResultBytes));
}

}  // namespace

void add_result_routes(Router& router) {
  const std::string job = "/api/v1/jobs/{id}/";
  router.add("GET", job + "dag", Role::kRead, get_dag);
  router.add("GET", job + "report", Role::kRead, get_report);
  router.add("GET", job + "preview.png", Role::kRead, get_preview);
  router.add("GET", job + "log", Role::kRead, get_log, {"max_bytes"});
  router.add("GET", job + "subvolumes", Role::kRead, get_subvolumes);
}

}  // namespace voxdag::server
