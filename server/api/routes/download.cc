#include "server/api/routes/download.h"

#include <nlohmann/json.hpp>

#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/fields/json_text.h"
#include "core/io/random_id.h"
#include "scene/messages.h"
#include "server/api/answers/public_problem.h"
#include "server/http/message/digest_field.h"

namespace voxdag::server {
namespace {

constexpr const char* kFileType = "application/octet-stream";

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
  return request.method == "GET" && size > 0 ? parse_ranges(request.header("Range"), size)
                                             : RangeAnswer{};
}

void add_multipart(Response& response, const std::vector<ByteRange>& ranges, uint64_t size) {
  const std::string boundary = random_id() + random_id();
  for (const ByteRange& range : ranges)
    response.pieces.push_back({"\r\n--" + boundary + "\r\nContent-Type: " + kFileType +
                                   "\r\nContent-Range: " + content_range(range, size) + "\r\n\r\n",
                               range});
  response.pieces.push_back({"\r\n--" + boundary + "--\r\n", {}});
  response.headers.emplace("Content-Type", "multipart/byteranges; boundary=" + boundary);
}

// Answers with a large file. The answer is the complete file (200), one range or several ranges
// (206), or 304 (RFC 9110, sections 13 and 14). The ETag is the file's SHA-256 in hex. Throws
// Problem (416).
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
      response.headers.emplace("Content-Type", kFileType);
      response.pieces.push_back({"", requested.ranges[0]});
    } else {
      add_multipart(response, requested.ranges, size);
    }
  } else {
    response.headers.emplace("Content-Type", kFileType);
    response.pieces.push_back({"", {0, size}});
  }
  response.file = std::move(file);
  return response;
}

}  // namespace

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

std::string download_stem(const Job& job, uint64_t resolution) {
  std::string base = job.name;
  if (base.empty()) {
    base = parse_json<nlohmann::json>(job.request).at("scene").at(0).get<std::string>();
    base = base.substr(base.rfind('/') + 1);
    base = base.substr(0, base.rfind('.'));
  }
  // Other characters, also those of several bytes, become one dash. fileName() in
  // server/web/views/job_actions.js has the same rule.
  std::string stem;
  bool is_replaced = false;
  for (const char c : base) {
    const bool was_replaced = is_replaced;
    is_replaced = !isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '_' && c != '-';
    if (!is_replaced || !was_replaced) stem += is_replaced ? '-' : c;
  }
  return stem.substr(0, 100) + "-" + std::to_string(resolution);
}

Response download(Context& context, Call& call, std::shared_ptr<ReadableFile> file,
                  const std::string& sha256, const std::string& name) {
  auto permit = context.downloads.acquire(call.caller.client);
  if (!permit) throw busy("too many concurrent downloads: " + context.downloads.limits(), 5);
  Response response = answer_with_file(call.request, std::move(file), sha256, name);
  if (response.file) {
    response.permit = std::move(permit);
    if (call.request.method == "GET")
      for (const FilePiece& piece : response.pieces)
        context.metrics.count_downloaded(piece.range.size());
  }
  return response;
}

Route download_route(Route route) {
  route.headers = {{"Range", "bytes=FIRST-LAST"},
                   {"If-Range", "ETag of the file that the range refers to"},
                   {"If-None-Match", "known ETags"}};
  route.answers = {
      {200,
       "the complete file",
       {{kFileType}},
       {{"ETag", "its SHA-256"}, {"Accept-Ranges", "bytes"}}},
      {206, "one range, or several as multipart", {{kFileType}, {"multipart/byteranges"}}},
      {304, "the file has one of the known ETags"}};
  route.problems.insert(route.problems.end(), {404, 416});
  return route;
}

}  // namespace voxdag::server
