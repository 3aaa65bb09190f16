// Serves the results of a job: its file, report, preview, log and subvolumes.
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/text/printable.h"
#include "core/io/random_id.h"
#include "scene/messages.h"
#include "server/api/answers/public_problem.h"
#include "server/api/context/context.h"
#include "server/api/routes/routes.h"
#include "server/base/json_text.h"
#include "server/http/message/digest_field.h"

namespace voxdag::server {
namespace {

constexpr const char* kDagType = "application/octet-stream";
constexpr uint64_t kMaxSentReportBytes = uint64_t{1} << 20;
const Parameter kMaxLogBytes = {"max_bytes", "maximum size of the answer", "",
                                IntegerRange{1, 1 << 20, 65536}};

Job finished_job(Context& context, Call& call) {
  Job job = find_job(context.queue, call.names[0]);
  if (job.state != JobState::kSucceeded) {
    Problem problem = not_found(std::string("the job is ") + state_name(job.state) +
                                " and has no result: expected a succeeded job");
    problem.state = state_name(job.state);
    throw problem;
  }
  return job;
}

// Returns the file name of a download, NAME-RESOLUTION.vdag. NAME is the name of the job, or of its
// first scene if the job has no name, reduced to characters that are safe in headers and shells.
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
  // If-Range can also contain a date or another entity tag. In both cases the answer is the
  // complete file.
  if (condition != request.headers.end() && trimmed(condition->second) != tag) return {};
  // Only GET requests can have ranges (RFC 9110, 14.2).
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

// Answers with a large file, which must not be empty. The answer is the complete file (200), one
// range or several ranges (206), or 304 (RFC 9110, sections 13 and 14). The ETag is the file's
// SHA-256 in hex. Throws Problem (416).
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
    Problem problem(416, "range_not_satisfiable",
                    "the range '" + printable(request.header("Range")) +
                        "' is not within the file: expected bytes from 0 to " +
                        std::to_string(size - 1));
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
  if (!permit) throw busy("too many concurrent downloads: " + context.downloads.limits(), 5);
  Response response = answer_with_file(
      call.request, context.files.open_own(context.dispatcher.folder(job.id).result()),
      nlohmann::json::parse(job.result).at("sha256"), file_name(job));
  if (response.file) {
    response.permit = std::move(permit);
    if (call.request.method == "GET")
      for (const FilePiece& piece : response.pieces)
        context.metrics.count_downloaded(piece.range.size());
  }
  return response;
}

// Answers with a complete file, which is read while it is sent.
Response stream_file(Context& context, const std::string& path, Response response) {
  response.file = context.files.open_own(path);
  response.pieces.push_back({"", {0, response.file->size()}});
  return response;
}

Response get_report(Context& context, Call& call) {
  auto permit = context.answers.wait();
  const Job job = finished_job(context, call);
  auto report = nlohmann::ordered_json::parse(read_own_file(
      context.files, context.dispatcher.folder(job.id).report(), kMaxSentReportBytes));
  report["output"] = file_name(job);
  make_printable(report);
  Response response = json_response(200, json_text(report));
  response.build_permit = std::move(permit);
  return response;
}

Response get_preview(Context& context, Call& call) {
  const Job job = finished_job(context, call);
  const std::string path = context.dispatcher.folder(job.id).preview();
  if (job.preview != Preview::kReady || !context.files.exists(path))
    throw not_found(
        job.preview == Preview::kFailed
            ? "the preview could not be rendered: expected a file that voxdag render can render"
            : "the preview is not rendered yet: expected a request later");
  return stream_file(context, path, make_response(200, "image/png", "private, max-age=3600"));
}

Response get_log(Context& context, Call& call) {
  const uint64_t max_bytes = call.query_integer(kMaxLogBytes);
  const Job job = find_job(context.queue, call.names[0]);
  const std::string path = context.dispatcher.folder(job.id).log();
  Response response = make_response(200, "text/plain; charset=utf-8", "no-store");
  if (!context.files.exists(path)) return response;
  response.build_permit = context.answers.wait();
  const auto file = context.files.open_own(path);
  const uint64_t size = file->size(), begin = size - std::min(size, max_bytes);
  response.body.resize(size - begin);
  file->read_at(begin, std::as_writable_bytes(std::span(response.body)));
  if (begin > 0) response.body.erase(0, response.body.find('\n') + 1);
  response.body = printable_lines(response.body);
  return response;
}

Response get_subvolumes(Context& context, Call& call) {
  const Job job = find_job(context.queue, call.names[0]);
  const std::string path = context.dispatcher.folder(job.id).subvolumes();
  if (!context.files.exists(path))
    throw not_found(
        "the subvolumes of the job are not planned yet: expected a job that has read its scene");
  return stream_file(context, path, json_response(200, ""));
}

}  // namespace

void add_result_routes(Router& router) {
  const auto add = [&](const std::string& path, const std::string& id, const std::string& summary,
                       Answer answer, Router::Handler handler,
                       const std::vector<Parameter>& query = {}) {
    router.add({.method = "GET",
                .pattern = "/api/v1/jobs/{id}/" + path,
                .id = id,
                .summary = summary,
                .tag = "results",
                .query = query,
                .answers = {std::move(answer)},
                .problems = {404}},
               std::move(handler));
  };
  router.add({.method = "GET",
              .pattern = "/api/v1/jobs/{id}/dag",
              .id = "getDag",
              .summary = "The .vdag file or ranges of it",
              .tag = "results",
              .headers = {{"Range", "bytes=FIRST-LAST"},
                          {"If-Range", "ETag of the file that the range refers to"},
                          {"If-None-Match", "known ETags"}},
              .answers = {{200,
                           "the complete file",
                           {{kDagType}},
                           {{"ETag", "its SHA-256"}, {"Accept-Ranges", "bytes"}}},
                          {206,
                           "one range, or several as multipart",
                           {{kDagType}, {"multipart/byteranges"}}},
                          {304, "the file has one of the known ETags"}},
              .problems = {404, 416}},
             get_dag);
  add("report", "getReport", "The report of the build",
      {200, "the output of voxdag build --json", {json_content()}}, get_report);
  add("preview.png", "getPreview", "A rendered preview",
      {200, "a PNG of 960 x 540 pixels", {{"image/png"}}}, get_preview);
  add("log", "getLog", "The tail of the log", {200, "complete lines of text", {{"text/plain"}}},
      get_log, {kMaxLogBytes});
  add("subvolumes", "getSubvolumes", "The occupied subvolumes and whether they are built",
      {200, "cubes in voxels", {json_content("Subvolumes")}}, get_subvolumes);
}

}  // namespace voxdag::server
