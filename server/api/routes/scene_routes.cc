// Scenes: uploading, listing, removing.
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "server/api/context.h"
#include "server/api/job_json.h"
#include "server/api/problem.h"
#include "server/api/routes/router.h"
#include "server/http/digest_field.h"
#include "server/scenes/upload.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxListed = 200;
constexpr size_t kStandardListed = 100;

nlohmann::ordered_json scene_json(const Scene& scene) {
  nlohmann::ordered_json json = {
      {"name", scene.name}, {"complete", scene.complete},
      {"size", nullptr},    {"offset", scene.offset},
      {"sha256", nullptr},  {"modified_at", time_text(scene.modified_s)}};
  if (scene.size) json["size"] = *scene.size;
  if (scene.complete) json["sha256"] = scene.sha256;
  return json;
}

std::string checked_name(const Call& call) {
  if (!is_scene_name(call.names[0]))
    throw bad_request(
        "a scene's name: expected 1 to 128 of A-Z a-z 0-9 . _ -, beginning with a letter or digit "
        "and ending with .glb or .gltf");
  return call.names[0];
}

// SCENE, with what an upload that goes on needs to know.
Response scene_response(Context& context, int status, const std::string& name) {
  const auto scene = context.scenes.find(name);
  if (!scene) throw not_found("no scene of this name");
  Response response = json_response(status, scene_json(*scene).dump());
  const auto upload = context.scenes.upload(name);
  const uint64_t offset = upload ? upload->offset : scene->offset;
  const std::optional<uint64_t> total = upload ? upload->total : scene->size;
  response.headers.emplace("Upload-Offset", std::to_string(offset));
  if (total) response.headers.emplace("Upload-Length", std::to_string(*total));
  return response;
}

void check_unused(Context& context, const std::string& name) {
  if (context.queue.uses_scene(name)) throw conflict("a job that has not ended uses this scene");
}

// Which bytes of the scene a request brings.
struct Part {
  uint64_t first = 0;
  std::optional<uint64_t> end;    // if it says so
  std::optional<uint64_t> total;  // of the whole
  bool completes(uint64_t offset) const { return !total || offset == *total; }
};

Part part_of(const Request& request) {
  Part part;
  const std::string header = request.header("Content-Range");
  if (header.empty()) {
    part.end = part.total = request.content_length;
    return part;
  }
  ByteRange range;
  uint64_t total = 0;
  if (!parse_content_range(header, range, total))
    throw bad_request("Content-Range: expected bytes FIRST-LAST/TOTAL");
  if (request.content_length && *request.content_length != range.size())
    throw bad_request("Content-Range and Content-Length do not agree");
  return {range.begin, range.end, total};
}

void check_disk_space(Context& context, const Part& part) {
  const uint64_t most = context.config.transfers.max_scene_bytes;
  const uint64_t size = part.total.value_or(0);
  if (size > most)
    throw Problem(413, "too_large", "a scene may have at most " + std::to_string(most) + " bytes");
  const uint64_t free = context.files.free_space(context.config.data_folder);
  if (free < context.config.jobs.min_free_disk_bytes + (size - std::min(size, part.first)))
    throw problem(ErrorCode::kNoSpace, "the service has no room for this scene");
}

BodyEnd receive(Context& context, Call& call, const Part& part, Upload& upload) {
  const uint64_t most = part.end.value_or(context.config.transfers.max_scene_bytes);
  uint64_t received = part.first;
  const BodyEnd end = call.request.read_body([&](std::string_view piece) {
    received += piece.size();
    if (received > most) return false;
    upload.write(piece);
    context.metrics.count_uploaded(piece.size());
    return true;
  });
  if (end == BodyEnd::kWhole && part.end && received != *part.end)
    throw bad_request("the body is shorter than Content-Range says");
  return end;
}

// "" if the header is not there.
std::string digest_of(const Request& request, const char* name) {
  const auto found = request.headers.find(name);
  return found == request.headers.end() ? "" : parse_digest_field(found->second);
}

Response put_scene(Context& context, Call& call) {
  call.allow_query({});
  const std::string name = checked_name(call);
  const auto slot = context.transfers.take();
  if (!slot) throw busy("too many transfers at a time", 5);
  const Part part = part_of(call.request);
  if (!call.request.has_body) throw bad_request("expected the scene's bytes as body");
  check_disk_space(context, part);
  check_unused(context, name);
  const std::string part_digest = digest_of(call.request, "Content-Digest");
  const std::string whole_digest = digest_of(call.request, "Repr-Digest");
  Upload upload(context.scenes, name, part.first, part.total);
  switch (receive(context, call, part, upload)) {
    case BodyEnd::kWhole:
      break;
    case BodyEnd::kStopped:
      throw Problem(413, "too_large", "the body is longer than it may be");
    case BodyEnd::kTooSlow:
      throw Problem(408, "timeout", "the body came too slowly; what came is kept");
    case BodyEnd::kBroken:
      throw bad_request("the body broke off; what came is kept");
  }
  const bool last = part.completes(part.end.value_or(part.total.value_or(0)));
  if (!upload.finish(part_digest, whole_digest, last)) return scene_response(context, 202, name);
  std::lock_guard lock(context.scene_use);
  check_unused(context, name);
  const bool replaces = context.scenes.find(name).value_or(Scene{}).complete;
  upload.publish();
  return scene_response(context, replaces ? 200 : 201, name);
}

Response list_scenes(Context& context, Call& call) {
  call.allow_query({"limit", "cursor"});
  const size_t limit = call.query_count("limit", kStandardListed, 1, kMaxListed);
  const std::string cursor = call.query("cursor");
  if (call.request.target.query.contains("cursor") && !is_scene_name(cursor))
    throw bad_request("'cursor': expected a next_cursor");
  auto scenes = context.scenes.list(cursor, limit + 1);
  nlohmann::ordered_json json = {{"scenes", nlohmann::ordered_json::array()},
                                 {"next_cursor", nullptr}};
  if (scenes.size() > limit) {
    scenes.resize(limit);
    json["next_cursor"] = scenes.back().name;
  }
  for (const Scene& scene : scenes) json["scenes"].push_back(scene_json(scene));
  return json_response(200, json.dump());
}

Response delete_scene(Context& context, Call& call) {
  call.allow_query({});
  expect_no_body(call.request);
  const std::string name = checked_name(call);
  std::lock_guard lock(context.scene_use);
  check_unused(context, name);
  if (!context.scenes.remove(name)) throw not_found("no scene of this name");
  Response response;
  response.status = 204;
  return response;
}

}  // namespace

void add_scene_routes(Router& router, Context& context) {
  router.add("GET", "/api/v1/scenes", Role::kRead,
             [&](Call& call) { return list_scenes(context, call); });
  router.add("GET", "/api/v1/scenes/{name}", Role::kRead, [&](Call& call) {
    call.allow_query({});
    return scene_response(context, 200, checked_name(call));
  });
  router.add("PUT", "/api/v1/scenes/{name}", Role::kSubmit,
             [&](Call& call) { return put_scene(context, call); });
  router.add("DELETE", "/api/v1/scenes/{name}", Role::kAdmin,
             [&](Call& call) { return delete_scene(context, call); });
}

}  // namespace voxdag::server
