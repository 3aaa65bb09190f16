// Exports of a job's result: creating, listing, showing, downloading and deleting them.
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/format/global/open_global.h"
#include "scene/messages.h"
#include "server/api/answers/export_json.h"
#include "server/api/answers/public_problem.h"
#include "server/api/context/context.h"
#include "server/api/routes/download.h"
#include "server/api/routes/routes.h"
#include "server/jobs/protocol/export_spec.h"

namespace voxdag::server {
namespace {

constexpr const char* kExports = "/api/v1/jobs/{id}/exports";
constexpr const char* kExport = "/api/v1/jobs/{id}/exports/{export}";

std::string json_of(Context& context, const Export& it) {
  return export_json(it, context.dispatcher.exports().live(it.id).get());
}

Export find_export(Context& context, const Call& call) {
  find_job(context.queue, call.names[0]);
  return context.dispatcher.exports().find(call.names[0], call.names[1]);
}

// Throws Problem (507) if jobs would not start because of the disk.
void expect_disk_space(Context& context) {
  if (!context.disk.is_low()) return;
  throw Problem(507, error_name(ErrorCode::kNoSpace),
                "the disk of the service has " + size_text(context.disk.free()) +
                    " of free space: expected at least " +
                    size_text(context.config.jobs.min_free_disk_bytes) + " (jobs.min_free_disk)");
}

Response post_export(Context& context, Call& call) {
  const std::string body = read_json_body(call.request, context.config.transfers.max_body_bytes);
  const auto permit = context.answers.wait();
  const ExportSpec spec = parse_export_spec(body);
  const Job job = finished_job(context, call);
  if (context.draining) throw busy("the service is stopping: expected a request after its restart");
  const auto file = open_kept(job.id, "the result", kNewJobAdvice, [&] {
    return open_global_file(context.dispatcher.folder(job.id).result());
  });
  const uint64_t resolution = uint64_t{1} << selection_of(spec, *file).grid_levels;
  const std::string stem = download_stem(job, resolution) + (spec.region ? "-part" : "");
  expect_disk_space(context);
  const Exports::Added added = context.dispatcher.exports().add(job.id, export_spec_text(spec),
                                                                export_file_name(spec, stem));
  return json_response(added.is_new ? 202 : 200, json_of(context, added.it));
}

Response list_exports(Context& context, Call& call) {
  auto permit = context.answers.wait();
  const Job job = find_job(context.queue, call.names[0]);
  std::string body = "{\"exports\":[";
  for (const char* separator = ""; const Export& it : context.dispatcher.exports().list(job.id)) {
    body += separator + json_of(context, it);
    separator = ",";
  }
  Response response = json_response(200, body + "]}");
  response.build_permit = std::move(permit);
  return response;
}

Response get_export(Context& context, Call& call) {
  return json_response(200, json_of(context, find_export(context, call)));
}

Response delete_export(Context& context, Call& call) {
  expect_no_body(call.request);
  find_job(context.queue, call.names[0]);
  Exports& exports = context.dispatcher.exports();
  return context.disk.with_ballast([&] {
    if (exports.remove(call.names[0], call.names[1])) return no_content();
    try {
      return json_response(202, json_of(context, exports.find(call.names[0], call.names[1])));
    } catch (const RequestError&) {
      return no_content();  // deleted since
    }
  });
}

Response get_export_file(Context& context, Call& call) {
  const Export it = find_export(context, call);
  if (it.state != ExportState::kSucceeded)
    throw not_found(std::string("the export is ") + name_of(it.state) +
                    " and has no files: expected a succeeded export");
  const auto number = parse_numbers<uint64_t, 1>(call.names[2], 0);
  if (!number || (*number)[0] >= it.result.files.size())
    throw not_found("the export has no file '" + printable(call.names[2]) +
                    "': expected a number from 0 to " + std::to_string(it.result.files.size() - 1));
  const ExportedFile& file = it.result.files[(*number)[0]];
  // The same request returns the existing export until a request deletes it.
  auto opened = open_kept(
      it.job, "the file " + file.name + " of the export " + it.id,
      "delete the export and request it again",
      [&] { return context.files.open_own(context.dispatcher.exports().path(it, file.name)); });
  return download(context, call, std::move(opened), file.sha256, file.name);
}

}  // namespace

void add_export_routes(Router& router) {
  router.add({.method = "POST",
              .pattern = kExports,
              .role = Role::kSubmit,
              .id = "postExport",
              .summary = "Write the result in another format, or a part of it",
              .tag = "exports",
              .body = json_content("ExportRequest"),
              .answers = {{200, "the export that has this request", {json_content("Export")}},
                          {202, "the queued export", {json_content("Export")}}},
              .problems = {404, 408, 409, 413, 415, 422}},
             post_export);
  router.add({.method = "GET",
              .pattern = kExports,
              .id = "listExports",
              .summary = "The exports of a job, oldest first",
              .tag = "exports",
              .answers = {{200, "all exports of the job", {json_content("ExportList")}}},
              .problems = {404}},
             list_exports);
  router.add({.method = "GET",
              .pattern = kExport,
              .id = "getExport",
              .summary = "One export",
              .tag = "exports",
              .answers = {{200, "the export", {json_content("Export")}}},
              .problems = {404}},
             get_export);
  router.add({.method = "DELETE",
              .pattern = kExport,
              .role = Role::kSubmit,
              .id = "deleteExport",
              .summary = "Cancel an export and delete its files",
              .tag = "exports",
              .answers = {{202, "its process is being stopped", {json_content("Export")}},
                          {204, "deleted"}},
              .problems = {404, 409}},
             delete_export);
  router.add(download_route({.method = "GET",
                             .pattern = std::string(kExport) + "/files/{file}",
                             .id = "getExportFile",
                             .summary = "A file of an export, or ranges of it",
                             .tag = "exports"}),
             get_export_file);
}

}  // namespace voxdag::server
