// Serves the results of a job: its file, report, preview, log and subvolumes.
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/text/printable.h"
#include "core/fields/json_text.h"
#include "server/api/answers/public_problem.h"
#include "server/api/context/context.h"
#include "server/api/routes/download.h"
#include "server/api/routes/routes.h"
#include "server/base/printable_json.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kMaxSentReportBytes = uint64_t{1} << 20;
const Parameter kMaxLogBytes = {"max_bytes", "maximum size of the answer", "",
                                IntegerRange{1, 1 << 20, 65536}};

// Returns the file name of the result.
std::string file_name(const Job& job) {
  return download_stem(job, parse_json<nlohmann::json>(job.request).at("resolution")) + ".vdag";
}

Response get_dag(Context& context, Call& call) {
  const Job job = finished_job(context, call);
  const auto open = [&] {
    return context.files.open_own(context.dispatcher.folder(job.id).result());
  };
  return download(context, call, open_kept(job.id, "the result", kNewJobAdvice, open),
                  parse_json<nlohmann::json>(job.result).at("sha256"), file_name(job));
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
  auto report =
      parse_json<nlohmann::ordered_json>(open_kept(job.id, "the report", kNewJobAdvice, [&] {
        return read_own_file(context.files, context.dispatcher.folder(job.id).report(),
                             kMaxSentReportBytes);
      }));
  report["output"] = file_name(job);
  make_printable(report);
  Response response = json_response(200, json_text(report));
  response.build_permit = std::move(permit);
  return response;
}

Response get_preview(Context& context, Call& call) {
  const Job job = finished_job(context, call);
  const std::string path = context.dispatcher.folder(job.id).preview();
  if (job.preview != Preview::kReady)
    throw not_found(
        job.preview == Preview::kFailed
            ? "the preview could not be rendered: expected a file that voxdag render can render"
            : "the preview is not rendered yet: expected a request later");
  return open_kept(job.id, "the preview", "render the downloaded result instead", [&] {
    return stream_file(context, path, make_response(200, "image/png", "private, max-age=3600"));
  });
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

// Answers with the rates of a running attempt, or else with the stored rates of the last attempt.
Response get_rates(Context& context, Call& call) {
  const Job job = find_job(context.queue, call.names[0]);
  const std::string path = context.dispatcher.folder(job.id).rates();
  if (const auto live = context.dispatcher.live(job.id)) {
    auto permit = context.answers.wait();
    Response response = json_response(200, live->rates_json());
    response.build_permit = std::move(permit);
    return response;
  }
  if (!context.files.exists(path)) return json_response(200, R"({"stages":[]})");
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
  router.add(download_route({.method = "GET",
                             .pattern = "/api/v1/jobs/{id}/dag",
                             .id = "getDag",
                             .summary = "The .vdag file or ranges of it",
                             .tag = "results"}),
             get_dag);
  add("report", "getReport", "The report of the build",
      {200, "the output of voxdag build --json", {json_content()}}, get_report);
  add("preview.png", "getPreview", "A rendered preview",
      {200, "a PNG of 960 x 540 pixels", {{"image/png"}}}, get_preview);
  add("log", "getLog", "The tail of the log", {200, "complete lines of text", {{"text/plain"}}},
      get_log, {kMaxLogBytes});
  add("subvolumes", "getSubvolumes", "The occupied subvolumes and whether they are built",
      {200, "cubes in voxels", {json_content("Subvolumes")}}, get_subvolumes);
  add("rates", "getRates", "The rate of each stage over time",
      {200, "points of a chart", {json_content("Rates")}}, get_rates);
}

}  // namespace voxdag::server
