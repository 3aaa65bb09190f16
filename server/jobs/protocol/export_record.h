// An export of a job's result, as stored in the file export.json of its folder,
// DATA/jobs/JOB/exports/ID.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/fields/field.h"

namespace voxdag::server {

//   queued ─▶ running ─▶ succeeded          A request to delete an export ends in its removal. If
//     ▲  ▲       │ └───▶ failed ─┐          its process runs, it is first in the state deleting.
//     │  └ stop ─┘               │
//     └──── the same request ────┘
enum class ExportState { kQueued, kRunning, kDeleting, kFailed, kSucceeded };
constexpr std::array<const char*, 5> enum_names(ExportState) {
  return {"queued", "running", "deleting", "failed", "succeeded"};
}

struct ExportedFile {
  std::string name;
  uint64_t bytes = 0;
  std::string sha256;  // 64 lower-case hex digits
};
template <class Visitor>
void fields(Visitor& visit, ExportedFile& file) {
  visit("name", file.name);
  visit("bytes", file.bytes);
  visit("sha256", file.sha256);
}

// The facts that the process of an export reports at its end.
struct ExportResult {
  std::vector<ExportedFile> files;
  uint64_t voxels = 0;
  std::vector<std::string> notes;     // usage notes for the files, one sentence each
  std::vector<std::string> warnings;  // one sentence each
};
template <class Visitor>
void fields(Visitor& visit, ExportResult& result) {
  visit("files", result.files);
  visit("voxels", result.voxels);
  visit("notes", result.notes);
  visit(Field("warnings").omit_empty(), result.warnings);
}

struct Export {
  std::string id;
  std::string job;
  ExportState state = ExportState::kQueued;
  std::string request;  // text of an ExportSpec
  std::string output;   // name of the (first) file
  // A queued export with a smaller number runs earlier. Records of earlier versions have no number.
  std::optional<uint64_t> turn;
  unsigned interruptions = 0;  // number of consecutive runs that ended because the service ended
  // Unix times in seconds; 0: never.
  double created_s = 0, started_s = 0, finished_s = 0;
  std::string error_code, error_message;  // "" without an error
  ExportResult result;                    // set if the export has succeeded
};
template <class Visitor>
void fields(Visitor& visit, Export& e) {
  visit("id", e.id);
  visit("job", e.job);
  visit("state", e.state);
  visit("request", e.request);
  visit("output", e.output);
  visit("turn", e.turn);
  visit("interruptions", e.interruptions);
  visit("created_s", e.created_s);
  visit("started_s", e.started_s);
  visit("finished_s", e.finished_s);
  visit("error_code", e.error_code);
  visit("error_message", e.error_message);
  visit("result", e.result);
}

}  // namespace voxdag::server
