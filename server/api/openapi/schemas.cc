#include "server/api/openapi/schemas.h"

#include <string>
#include <vector>

#include "core/fields/json_schema.h"
#include "server/jobs/protocol/export_record.h"
#include "server/jobs/protocol/export_spec.h"
#include "server/jobs/protocol/job_request.h"
#include "server/queue/job.h"

namespace voxdag::server {
namespace {
namespace openapi {

struct Member {
  std::string name;
  Json schema;
  bool is_required = true;
};

Member optional(std::string name, Json schema) {
  return {std::move(name), std::move(schema), false};
}

Json object(const std::vector<Member>& members) {
  Json json = {{"type", "object"}, {"required", Json::array()}};
  for (const auto& [name, schema, is_required] : members) {
    if (is_required) json["required"].push_back(name);
    json["properties"][name] = schema;
  }
  return json;
}

Json type(const char* name) { return {{"type", name}}; }
Json text() { return type("string"); }
Json number() { return type("number"); }
Json boolean() { return type("boolean"); }
Json integer() { return type("integer"); }
Json integer(uint64_t min, uint64_t max) {
  return {{"type", "integer"}, {"minimum", min}, {"maximum", max}};
}
Json at_least(uint64_t min) { return {{"type", "integer"}, {"minimum", min}}; }
Json count() { return at_least(0); }
Json pattern(const char* expression) { return {{"type", "string"}, {"pattern", expression}}; }
Json one_of(const std::vector<const char*>& texts) { return {{"type", "string"}, {"enum", texts}}; }
Json either(Json a, Json b) { return {{"oneOf", {std::move(a), std::move(b)}}}; }
Json or_null(const char* name) { return {{"type", {name, "null"}}}; }
Json time() { return {{"type", {"string", "null"}}, {"format", "date-time"}}; }

Json array(Json items) { return {{"type", "array"}, {"items", std::move(items)}}; }
Json array(size_t min, size_t max, Json items) {
  Json json = {{"type", "array"}, {"minItems", min}, {"maxItems", max}};
  json["items"] = std::move(items);
  return json;
}
Json array_of(size_t size, Json items) { return array(size, size, std::move(items)); }
Json map_of(Json values) {
  return {{"type", "object"}, {"additionalProperties", std::move(values)}};
}

Json named(const char* schema) { return {{"$ref", std::string("#/components/schemas/") + schema}}; }
Json named_or_null(const char* schema) { return either(type("null"), named(schema)); }

Json described(const char* description, Json schema) {
  schema["description"] = description;
  return schema;
}

Json state() { return one_of({kJobStateNames.begin(), kJobStateNames.end()}); }

void add_common(Json& all) {
  all["Problem"] = object({{"type", text()},
                           {"title", text()},
                           {"status", integer()},
                           {"code", text()},
                           {"detail", text()},
                           optional("state", state())});
  all["Point"] = array_of(3, number());
}

void add_scenes(Json& all) {
  all["Scene"] = object({{"name", text()},
                         {"complete", boolean()},
                         {"size_bytes", or_null("integer")},
                         {"received_bytes", count()},
                         {"sha256", or_null("string")},
                         {"modified_at", time()}});
  all["SceneList"] =
      object({{"scenes", array(named("Scene"))}, {"next_cursor", or_null("string")}});
}

void add_requests(Json& all) {
  Json request = options_schema<JobRequest>();
  request["examples"] = {{{"scene", "m.glb"}, {"resolution", 64}}};
  all["JobRequest"] = request;
  all["JobPatch"] = options_schema<JobPatch>();
  Json exported = options_schema<ExportSpec>();
  exported["properties"]["to"]["enum"] = export_spec_formats();
  exported["examples"] = {{{"to", "npz"}, {"level", 6}}};
  all["ExportRequest"] = exported;
}

void add_progress(Json& all) {
  all["Stage"] = object({{"name", text()},
                         {"unit", text()},
                         {"done", count()},
                         {"total", count()},
                         {"resumed_at", count()},
                         {"wall_s", number()},
                         {"ended", boolean()}});
  const Json nodes = array(object({{"name", text()}, {"running", count()}, {"built", count()}}));
  const Json cluster = object({{"batches", count()},
                               {"built", count()},
                               {"waiting", count()},
                               {"failed_attempts", count()},
                               {"nodes", nodes}});
  all["Progress"] =
      object({{"stage", text()},
              {"unit", text()},
              {"done", count()},
              {"total", count()},
              {"rate", number()},
              {"eta_s", number()},
              optional("overall",
                       described("progress over all stages; absent from records of old versions",
                                 object({{"fraction", number()}, {"eta_s", or_null("number")}}))),
              {"elapsed_s", number()},
              {"stages", array(named("Stage"))},
              {"subvolumes", object({{"built", count()}, {"total", count()}})},
              {"voxels", count()},
              {"nodes", count()},
              {"bytes", count()},
              {"memory_bytes", count()},
              {"disk_bytes", count()},
              optional("cluster", described("only of a job that a cluster builds", cluster))});
  const Json point = described("seconds since the stage began, units per second", array(number()));
  all["Rates"] = object(
      {{"stages", array(object({{"name", text()}, {"unit", text()}, {"points", array(point)}}))}});
}

void add_jobs(Json& all) {
  all["Result"] = object(
      {{"sha256", text()},
       {"bytes", count()},
       {"voxels", count()},
       {"svo_nodes", count()},
       {"dag_nodes", count()},
       {"triangles", count()},
       {"wall_s", number()},
       {"cpu_s", number()},
       {"peak_rss_bytes", count()},
       {"bounds", object({{"origin", array(number())}, {"edge", number()}})},
       {"levels", array(object({{"level", count()}, {"nodes", count()}, {"bytes", count()}}))}});
  all["JobError"] =
      object({{"code", text()}, {"message", text()}, {"at", time()}, {"transient", boolean()}});
  all["Webhook"] = object({{"origin", text()},
                           {"state", one_of({"waiting", "pending", "delivered", "failed"})},
                           {"delivery", or_null("string")},
                           {"attempts", count()},
                           {"status", or_null("integer")},
                           {"error", or_null("string")},
                           {"next_attempt_at", time()},
                           {"ended_at", time()}});
  all["Job"] = object({{"id", pattern("^[0-9a-f]{16}$")},
                       {"name", text()},
                       {"state", state()},
                       {"scene", array(text())},
                       {"resolution", count()},
                       {"options", type("object")},
                       {"labels", array(text())},
                       {"priority", integer()},
                       {"attempts", count()},
                       {"max_attempts", count()},
                       {"created_at", time()},
                       {"started_at", time()},
                       {"finished_at", time()},
                       {"not_before", time()},
                       {"position", or_null("integer")},
                       {"progress", named_or_null("Progress")},
                       {"result", named_or_null("Result")},
                       {"error", named_or_null("JobError")},
                       {"warnings", array(record_schema<Warning>())},
                       {"webhook", named_or_null("Webhook")},
                       {"preview", boolean()},
                       {"links", map_of(text())}});
  all["JobList"] = object({{"jobs", array(named("Job"))},
                           {"next_cursor", or_null("string")},
                           {"counts", map_of(count())}});
}

void add_exports(Json& all) {
  const std::vector<std::string> states = choices_of<ExportState>();
  all["ExportedFile"] =
      object({{"name", text()}, {"bytes", count()}, {"sha256", text()}, {"href", text()}});
  Json error = object({{"code", text()}, {"message", text()}});
  error["type"] = {"object", "null"};
  all["Export"] = object({{"id", pattern("^[0-9a-f]{16}$")},
                          {"job", pattern("^[0-9a-f]{16}$")},
                          {"state", {{"type", "string"}, {"enum", states}}},
                          {"request", type("object")},
                          {"created_at", time()},
                          {"started_at", time()},
                          {"finished_at", time()},
                          {"progress", named_or_null("Progress")},
                          {"error", error},
                          {"voxels", or_null("integer")},
                          {"notes", array(text())},
                          {"warnings", array(text())},
                          {"files", array(named("ExportedFile"))},
                          {"links", map_of(text())}});
  all["ExportList"] = object({{"exports", array(named("Export"))}});
}

void add_machine(Json& all) {
  all["Machine"] = object({{"version", text()},
                           {"cores", at_least(1)},
                           {"job_memory_bytes", count()},
                           {"max_concurrent_jobs", at_least(1)},
                           {"running_jobs", count()},
                           {"free_disk_bytes", count()},
                           {"min_free_disk_bytes", count()},
                           {"uptime_s", number()}});
}

void add_plan(Json& all) {
  all["EstimateRange"] = object({{"low", number()}, {"likely", number()}, {"high", number()}});
  std::vector<Member> members = {
      {"triangles", count()}, {"subvolumes", count()}, {"pilot_resolution", count()}};
  for (const char* range : {"voxels", "svo_nodes", "dag_nodes", "file_bytes", "disk_bytes",
                            "memory_bytes", "cpu_s", "wall_s"})
    members.push_back({range, named("EstimateRange")});
  members.push_back(optional("solid", object({{"rule", text()},
                                              {"interior", named("EstimateRange")},
                                              {"disputed", named("EstimateRange")},
                                              {"rows", count()},
                                              {"open_rows", count()},
                                              {"odd_rows", count()},
                                              {"warnings", array(record_schema<Warning>())}})));
  all["Plan"] = object(members);
}

// Returns the members that all manifests have.
std::vector<Member> manifest_members() {
  Json root = object({{"level", count()}, {"offset", count()}});
  root["type"] = {"object", "null"};
  return {{"digest", pattern("^[0-9a-f]{32}$")},
          {"resolution", at_least(4)},
          {"levels", integer(2, 20)},
          {"tile_levels", at_least(1)},
          {"batch_max", at_least(1)},
          {"origin", named("Point")},
          {"edge", number()},
          {"root", root},
          optional("root_brick", array_of(2, integer(0, UINT32_MAX))),
          optional("box", object({{"low", named("Point")}, {"high", named("Point")}})),
          optional("camera", named("Camera")),
          optional("tall_views", map_of(named("Camera")))};
}

void add_manifests(Json& all) {
  all["Camera"] = object(
      {{"position", named("Point")},
       {"target", named("Point")},
       {"fov_degrees", {{"type", "number"}, {"exclusiveMinimum", 0}, {"exclusiveMaximum", 180}}}});
  std::vector<Member> members = manifest_members();
  members.push_back({"voxels", pattern("^[0-9]+$")});
  members.push_back(optional("name", text()));
  members.push_back(
      optional("colors", object({{"levels", integer(2, 20)}, {"batch_max", at_least(1)}})));
  members.push_back(optional("views", map_of(named("Camera"))));
  all["TileManifest"] = object(members);
  members = manifest_members();
  members.push_back({"built", count()});
  members.push_back({"total", count()});
  members.push_back(
      optional("merged",
               described("true if the tiles are the complete DAG, for which the job still computes "
                         "colors or other attributes",
                         boolean())));
  all["PartialManifest"] = object(members);
}

void add_subvolumes(Json& all) {
  const std::vector<Member> members = {
      {"resolution", at_least(4)}, {"built", count()}, {"total", count()}};
  const auto with_cubes = [&](size_t values) {
    std::vector<Member> all_members = members;
    all_members.push_back({"cubes", array(array_of(values, count()))});
    return all_members;
  };
  all["Partial"] = object(with_cubes(6));
  std::vector<Member> subvolumes = with_cubes(5);
  subvolumes.push_back(
      optional("working", described("cubes that are being built", array(array_of(4, count())))));
  subvolumes.push_back(optional("origin", named("Point")));
  subvolumes.push_back(optional("edge", number()));
  all["Subvolumes"] = object(subvolumes);
}

Json make_schemas() {
  Json all;
  for (const auto add : {add_common, add_scenes, add_requests, add_progress, add_jobs, add_exports,
                         add_machine, add_plan, add_manifests, add_subvolumes})
    add(all);
  return all;
}

}  // namespace openapi
}  // namespace

const Json& schemas() {
  static const Json all = openapi::make_schemas();
  return all;
}

}  // namespace voxdag::server
