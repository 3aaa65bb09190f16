#include "scheduler/slurm/files/completion_record.h"

#include <span>

#include "core/base/error.h"
#include "core/fields/json_fields.h"
#include "core/fields/json_text.h"
#include "core/format/artifact/artifact_fields.h"
#include "core/format/checksum.h"

namespace voxdag {

template <class Visitor>
void fields(Visitor& visit, BuiltSubvolume& subvolume) {
  visit("id", subvolume.id);
  fields(visit, subvolume.summary);
}

template <class Visitor>
void fields(Visitor& visit, CompletionRecord& r) {
  visit("program", r.program);
  visit("build", r.build);
  visit("batch", r.batch);
  visit("attempt", r.attempt);
  visit("node", r.node);
  visit("task", r.task);
  visit("artifact", r.artifact);
  visit("segment_bytes", r.segment_bytes);
  visit("subvolumes", r.subvolumes);
  visit("rows_before", r.rows_before);
  visit("rows_after", r.rows_after);
  visit("split", r.split);
  visit("started_s", r.started_s);
  visit("wall_s", r.wall_s);
  visit("cpu_s", r.cpu_s);
  visit("peak_rss_bytes", r.peak_rss_bytes);
}

template <class Visitor>
void fields(Visitor& visit, AttemptFailure& failure) {
  visit("batch", failure.batch);
  visit("attempt", failure.attempt);
  visit("node", failure.node);
  visit("task", failure.task);
  visit("message", failure.message);
}

namespace {

std::string checksum_text(std::string_view text) {
  return std::to_string(checksum64(std::as_bytes(std::span(text))));
}

template <class Record>
std::string seal(const Record& record) {
  const std::string line = json_text(record_json(record));
  return line + "\n" + checksum_text(line) + "\n";
}

template <class Record>
Record open(const std::string& text) {
  const size_t end = text.find('\n');
  if (end == std::string::npos || text.substr(end + 1) != checksum_text(text.substr(0, end)) + "\n")
    throw Error(ErrorCode::kCorrupt,
                "it fails its checksum: expected one line of JSON and its checksum");
  return record_from_text<Record>(text.substr(0, end), "it");
}

}  // namespace

std::string encode_record(const CompletionRecord& record) { return seal(record); }
CompletionRecord decode_record(const std::string& text) { return open<CompletionRecord>(text); }

std::string encode_failure(const AttemptFailure& failure) { return seal(failure); }
AttemptFailure decode_failure(const std::string& text) { return open<AttemptFailure>(text); }

}  // namespace voxdag
