#include "server/api/file_answer.h"

#include "server/api/problem.h"
#include "server/http/byte_range.h"
#include "server/http/digest_field.h"
#include "server/random_id.h"

namespace voxdag::server {
namespace {

// Whether the value of If-None-Match has this entity tag. The comparison is weak.
bool has_tag(std::string_view list, std::string_view tag) {
  if (trimmed(list) == "*") return true;
  while (!list.empty()) {
    const size_t comma = std::min(list.find(','), list.size());
    std::string_view entry = trimmed(list.substr(0, comma));
    if (entry.starts_with("W/")) entry.remove_prefix(2);
    if (entry == tag) return true;
    list.remove_prefix(std::min(comma + 1, list.size()));
  }
  return false;
}

std::string content_range(const ByteRange& range, uint64_t size) {
  return "bytes " + std::to_string(range.begin) + "-" + std::to_string(range.end - 1) + "/" +
         std::to_string(size);
}

RangeAnswer requested_ranges(const Request& request, const std::string& tag, uint64_t size) {
  const auto condition = request.headers.find("If-Range");
  // An entity tag that differs, or a date, makes the answer the whole file.
  if (condition != request.headers.end() && trimmed(condition->second) != tag) return {};
  return parse_ranges(request.header("Range"), size);
}

void add_multipart(Response& response, const FileAnswer& answer,
                   const std::vector<ByteRange>& ranges, uint64_t size) {
  const std::string boundary = random_id() + random_id();
  for (const ByteRange& range : ranges)
    response.pieces.push_back({"\r\n--" + boundary + "\r\nContent-Type: " + answer.type +
                                   "\r\nContent-Range: " + content_range(range, size) + "\r\n\r\n",
                               range});
  response.pieces.push_back({"\r\n--" + boundary + "--\r\n", {}});
  response.headers.emplace("Content-Type", "multipart/byteranges; boundary=" + boundary);
}

}  // namespace

Response answer_with_file(const Request& request, FileAnswer answer) {
  const uint64_t size = answer.file->size();
  const std::string tag = '"' + answer.sha256 + '"';
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
  response.headers.emplace("Content-Disposition", "attachment; filename=\"" + answer.name + '"');
  response.headers.emplace("Repr-Digest", digest_field(answer.sha256));
  if (requested.kind == RangeAnswer::Kind::kPart) {
    response.status = 206;
    if (requested.ranges.size() == 1) {
      response.headers.emplace("Content-Range", content_range(requested.ranges[0], size));
      response.headers.emplace("Content-Type", answer.type);
      response.pieces.push_back({"", requested.ranges[0]});
    } else {
      add_multipart(response, answer, requested.ranges, size);
    }
  } else {
    response.headers.emplace("Content-Type", answer.type);
    response.pieces.push_back({"", {0, size}});
  }
  response.file = std::move(answer.file);
  return response;
}

}  // namespace voxdag::server
