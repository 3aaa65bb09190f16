#include "scheduler/slurm/files/completion_record.h"

#include <nlohmann/json.hpp>
#include <span>

#include "core/base/error.h"
#include "core/format/checksum.h"

namespace voxdag {
namespace {

using Json = nlohmann::ordered_json;

std::string checksum_text(std::string_view text) {
  return std::to_string(checksum64(std::as_bytes(std::span(text))));
}

std::string seal(const Json& json) {
  const std::string line = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  return line + "\n" + checksum_text(line) + "\n";
}

Json open(const std::string& text) {
  const size_t end = text.find('\n');
  if (end == std::string::npos || text.substr(end + 1) != checksum_text(text.substr(0, end)) + "\n")
    throw Error(ErrorCode::kCorrupt, "it fails its checksum");
  return Json::parse(text.substr(0, end));
}

// Runs `decode`, whose failures are those of a damaged text.
template <class Decode>
auto decode_checked(const Decode& decode) {
  try {
    return decode();
  } catch (const nlohmann::json::exception& error) {
    throw Error(ErrorCode::kCorrupt, std::string("it has other members (") + error.what() + ")");
  }
}

}  // namespace

std::string encode_record(const CompletionRecord& r) {
  Json subvolumes = Json::array();
  for (const BuiltSubvolume& s : r.subvolumes)
    subvolumes.push_back(
        {s.id, s.summary.voxels, s.summary.svo_nodes, s.summary.dag_nodes, s.summary.root_hash});
  return seal({{"program", r.program},
               {"build", r.build},
               {"batch", r.batch},
               {"attempt", r.attempt},
               {"node", r.node},
               {"task", r.task},
               {"artifact",
                {r.artifact.segment, r.artifact.offset, r.artifact.bytes, r.artifact.index_offset,
                 r.artifact.checksum}},
               {"segment_bytes", r.segment_bytes},
               {"subvolumes", subvolumes},
               {"rows_before", r.rows_before},
               {"rows_after", r.rows_after},
               {"split", r.split},
               {"started_s", r.started_s},
               {"wall_s", r.wall_s},
               {"cpu_s", r.cpu_s},
               {"peak_rss_bytes", r.peak_rss_bytes}});
}

CompletionRecord decode_record(const std::string& text) {
  return decode_checked([&] {
    const Json json = open(text);
    CompletionRecord r;
    r.program = json.at("program");
    r.build = json.at("build");
    r.batch = json.at("batch");
    r.attempt = json.at("attempt");
    r.node = json.at("node");
    r.task = json.at("task");
    const Json& a = json.at("artifact");
    r.artifact = {.segment = a.at(0),
                  .offset = a.at(1),
                  .bytes = a.at(2),
                  .index_offset = a.at(3),
                  .checksum = a.at(4)};
    r.segment_bytes = json.at("segment_bytes");
    for (const Json& s : json.at("subvolumes"))
      r.subvolumes.push_back(
          {s.at(0),
           {.voxels = s.at(1), .svo_nodes = s.at(2), .dag_nodes = s.at(3), .root_hash = s.at(4)}});
    r.rows_before = json.at("rows_before");
    r.rows_after = json.at("rows_after");
    r.split = json.at("split");
    r.started_s = json.at("started_s");
    r.wall_s = json.at("wall_s");
    r.cpu_s = json.at("cpu_s");
    r.peak_rss_bytes = json.at("peak_rss_bytes");
    return r;
  });
}

std::string encode_failure(const AttemptFailure& f) {
  return seal({{"batch", f.batch},
               {"attempt", f.attempt},
               {"node", f.node},
               {"task", f.task},
               {"message", f.message}});
}

AttemptFailure decode_failure(const std::string& text) {
  return decode_checked([&] {
    const Json json = open(text);
    return AttemptFailure{json.at("batch"), json.at("attempt"), json.at("node"), json.at("task"),
                          json.at("message")};
  });
}

}  // namespace voxdag
