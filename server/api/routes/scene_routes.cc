// Scenes: uploading, listing and removing them.
#include <charconv>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/fields/json_text.h"
#include "scene/formats/formats.h"
#include "scene/messages.h"
#include "server/api/answers/job_json.h"
#include "server/api/answers/public_problem.h"
#include "server/api/context/context.h"
#include "server/api/routes/routes.h"
#include "server/base/time_text.h"
#include "server/http/message/digest_field.h"
#include "server/scenes/scene_upload.h"

namespace voxdag::server {
namespace {

const Parameter kSceneLimit = {"limit", "maximum number of entries", "", IntegerRange{1, 200, 100}};
const Parameter kSceneCursor = {"cursor", "next_cursor of the previous page", scene_name_pattern()};
const Parameter kContentRange = {
    "Content-Range",
    "bytes FIRST-LAST/TOTAL of a part; bytes */TOTAL, with an empty body, finishes an upload that "
    "has all its bytes",
    "^(bytes ([0-9]{1,18}-[0-9]{1,18}|\\*)/[0-9]{1,18})?$"};
constexpr const char* kDigestPattern = "^(sha-256=:[A-Za-z0-9+/]{43}=:)?$";
const Parameter kContentDigest = {"Content-Digest", "sha-256=:BASE64: of this part",
                                  kDigestPattern};
const Parameter kReprDigest = {"Repr-Digest", "sha-256=:BASE64: of the complete scene",
                               kDigestPattern};

nlohmann::ordered_json scene_json(const Scene& scene) {
  nlohmann::ordered_json json = {
      {"name", scene.name},    {"complete", scene.complete},
      {"size_bytes", nullptr}, {"received_bytes", scene.offset},
      {"sha256", nullptr},     {"modified_at", time_text(scene.modified_s)}};
  if (scene.size) json["size_bytes"] = *scene.size;
  if (scene.complete) json["sha256"] = scene.sha256;
  return json;
}

std::string checked_name(const Call& call) {
  if (!is_scene_name(call.names[0]))
    throw bad_request("scene name '" + printable(call.names[0]) +
                      std::string("': expected 1 to 128 of A-Z a-z 0-9 . _ -, beginning "
                                  "with a letter or digit and "
                                  "ending with ") +
                      list_scene_endings());
  return call.names[0];
}

// Returns the scene as JSON (SCENE in docs/api.md), with the headers that a client needs to resume
// an upload.
Response scene_response(Context& context, int status, const std::string& name) {
  const auto scene = context.scenes.find(name);
  if (!scene)
    throw not_found("no such scene: '" + name + "': expected the name of an uploaded scene");
  Response response = json_response(status, exact_json_text(scene_json(*scene)));
  const auto upload = context.scenes.upload(name);
  const uint64_t offset = upload ? upload->offset : scene->offset;
  const std::optional<uint64_t> total = upload ? upload->total : scene->size;
  response.headers.emplace("Upload-Offset", std::to_string(offset));
  if (total) response.headers.emplace("Upload-Length", std::to_string(*total));
  return response;
}

void check_unused(Context& context, const std::string& name) {
  if (context.queue.uses_scene(name))
    throw conflict("the scene '" + name +
                   "' is in use by a job that has not ended: expected an unused scene; cancel the "
                   "job or wait for it");
}

// The part of a scene that a request's body contains: the bytes from `first` to `end`, exclusive.
struct Part {
  uint64_t first = 0;
  std::optional<uint64_t> end;    // nullopt for a chunked body
  std::optional<uint64_t> total;  // size of the scene, if known
  // True if a part that ends at `offset` completes the scene. True for every part without a total.
  bool is_last(uint64_t offset) const { return !total || offset == *total; }
};

// Returns TOTAL of the Content-Range "bytes */TOTAL", which finishes an upload that has all its
// bytes; nullopt for a different form of the header.
std::optional<uint64_t> total_of_empty_part(const std::string& text) {
  constexpr std::string_view kBegin = "bytes */";
  std::string_view header = text;
  if (!header.starts_with(kBegin)) return {};
  header.remove_prefix(kBegin.size());
  uint64_t total = 0;
  const auto [end, error] = std::from_chars(header.data(), header.data() + header.size(), total);
  if (error != std::errc{} || end != header.data() + header.size() || total == 0)
    throw bad_request("Content-Range: '" + printable(text) +
                      "': expected bytes */TOTAL with a TOTAL above 0");
  return total;
}

Part part_of(const Request& request) {
  Part part;
  const std::string header = request.header("Content-Range");
  if (header.empty()) {
    part.end = part.total = request.content_length;
    if (!request.has_body) throw bad_request("the request has no body: expected the scene");
    return part;
  }
  if (const auto whole = total_of_empty_part(header)) {
    if (request.has_body)
      throw bad_request(
          "the request with Content-Range: bytes */TOTAL has a body: expected an empty body");
    return {*whole, whole, whole};
  }
  ByteRange range;
  uint64_t total = 0;
  if (!parse_content_range(header, range, total))
    throw bad_request("Content-Range: '" + printable(header) +
                      "': expected bytes FIRST-LAST/TOTAL with FIRST <= LAST < TOTAL");
  if (request.content_length && *request.content_length != range.size())
    throw bad_request("Content-Length is " + std::to_string(*request.content_length) +
                      ": expected " + std::to_string(range.size()) +
                      ", the number of bytes of the Content-Range");
  if (!request.has_body)
    throw bad_request("the request has no body: expected the part of the scene");
  return {range.begin, range.end, total};
}

// Returns the number of bytes that the client has announced but not sent yet; 0 if the client has
// not announced a total. Throws Problem (413) if the total exceeds the limit for scenes.
uint64_t announced_bytes(Context& context, const Part& part) {
  const uint64_t max_bytes = context.config.transfers.max_scene_bytes;
  const uint64_t size = part.total.value_or(0);
  if (size > max_bytes)
    throw Problem(413, "too_large",
                  "the scene has " + std::to_string(size) + " bytes: expected at most " +
                      std::to_string(max_bytes));
  return size - std::min(size, part.first);
}

// Writes the request's body to `upload`. If the body is longer than the part, stops reading and
// returns kStopped. Throws Problem (400) for a body that is shorter than the part, or empty.
BodyEnd receive(Context& context, Call& call, const Part& part, DiskSpace::Reservation& space,
                SceneUpload& upload) {
  const uint64_t end_offset = part.end.value_or(context.config.transfers.max_scene_bytes);
  uint64_t received = part.first;
  const BodyEnd end = call.request.read_body([&](std::string_view piece) {
    received += piece.size();
    if (received > end_offset) return false;
    space.use(piece.size());
    upload.write(piece);
    context.metrics.count_uploaded(piece.size());
    return true;
  });
  if (end == BodyEnd::kComplete && part.end && received != *part.end)
    throw bad_request("the body has " + std::to_string(received - part.first) +
                      " bytes: expected " + std::to_string(*part.end - part.first));
  if (end == BodyEnd::kComplete && !part.end && received == part.first)
    throw bad_request("the body is empty: expected the scene");
  return end;
}

// Returns the SHA-256 in a digest header; "" if the request has no such header.
std::string digest_of(const Request& request, const char* name) {
  const auto found = request.headers.find(name);
  return found == request.headers.end() ? "" : parse_digest_field(found->second);
}

// Throws Problem (503) while the service is stopping. A stopping service accepts no new parts. It
// also stops computing the digest of a received scene; the client can finish that upload later.
void check_running(const Context& context) {
  if (context.draining) throw busy("the service is stopping; resume at Upload-Offset");
}

Response put_scene(Context& context, Call& call) {
  check_running(context);
  const std::string name = checked_name(call);
  const auto permit = context.uploads.acquire(call.caller.client);
  if (!permit) throw busy("too many concurrent uploads: " + context.uploads.limits(), 5);
  const Part part = part_of(call.request);
  const uint64_t announced = announced_bytes(context, part);
  check_unused(context, name);
  const std::string part_digest = digest_of(call.request, "Content-Digest");
  const std::string whole_digest = digest_of(call.request, "Repr-Digest");
  SceneUpload upload(context.scenes, name, part.first, part.total);
  // Declared after `upload`: if the upload starts over, the constructor of `upload` frees the space
  // of the earlier bytes, and only then this line reserves space.
  DiskSpace::Reservation space(context.disk, announced);
  switch (receive(context, call, part, space, upload)) {
    case BodyEnd::kComplete:
      break;
    case BodyEnd::kStopped:
      throw Problem(413, "too_large",
                    part.end ? "the body is larger than the announced part: expected " +
                                   std::to_string(*part.end - part.first) + " bytes"
                             : "the scene has more bytes than expected: at most " +
                                   std::to_string(context.config.transfers.max_scene_bytes));
    case BodyEnd::kTooSlow:
      throw Problem(408, "timeout", "the body was sent too slowly; resume at Upload-Offset");
    case BodyEnd::kBroken:
      throw bad_request(
          "the connection ended within the body, or the body's chunks are malformed; resume at "
          "Upload-Offset");
  }
  const bool last = part.is_last(part.end.value_or(part.total.value_or(0)));
  const auto check = [&] { check_running(context); };
  if (!upload.finish(part_digest, whole_digest, last, check))
    return scene_response(context, 202, name);
  std::lock_guard lock(context.scene_mutex);
  check_unused(context, name);
  const bool replaces = context.scenes.find(name).value_or(Scene{}).complete;
  upload.publish();
  return scene_response(context, replaces ? 200 : 201, name);
}

Response list_scenes(Context& context, Call& call) {
  auto permit = context.answers.wait();
  const size_t limit = call.query_integer(kSceneLimit);
  const std::string cursor = call.query("cursor");
  if (call.request.target.query.contains("cursor") && !is_scene_name(cursor))
    throw bad_request("'cursor' is '" + printable(cursor) +
                      "': expected the next_cursor of a page");
  auto scenes = context.scenes.list(cursor, limit + 1);
  nlohmann::ordered_json json = {{"scenes", nlohmann::ordered_json::array()},
                                 {"next_cursor", nullptr}};
  if (scenes.size() > limit) {
    scenes.resize(limit);
    json["next_cursor"] = scenes.back().name;
  }
  for (const Scene& scene : scenes) json["scenes"].push_back(scene_json(scene));
  Response response = json_response(200, exact_json_text(json));
  response.build_permit = std::move(permit);
  return response;
}

Response get_scene(Context& context, Call& call) {
  return scene_response(context, 200, checked_name(call));
}

Response delete_scene(Context& context, Call& call) {
  expect_no_body(call.request);
  const std::string name = checked_name(call);
  std::lock_guard lock(context.scene_mutex);
  check_unused(context, name);
  if (context.planned_scenes.contains(name))
    throw conflict("the scene '" + name +
                   "' is in use by a dry run: expected an unused scene; wait for the dry run");
  const bool found = context.disk.with_ballast([&] { return context.scenes.remove(name); });
  if (!found)
    throw not_found("no such scene: '" + name + "': expected the name of an uploaded scene");
  return no_content();
}

}  // namespace

void add_scene_routes(Router& router) {
  const std::string scene = "/api/v1/scenes/{name}";
  const std::vector<Content> body = {json_content("Scene")};
  const IntegerRange any_size{0, INT64_MAX};
  const std::vector<Parameter> headers = {
      {"Upload-Offset", "bytes received", "", any_size},
      {"Upload-Length", "bytes of the complete scene, once known", "", any_size}};
  router.add({.method = "GET",
              .pattern = "/api/v1/scenes",
              .id = "listScenes",
              .summary = "Scenes, by name",
              .tag = "scenes",
              .query = {kSceneLimit, kSceneCursor},
              .answers = {{200, "a page of scenes", {json_content("SceneList")}}}},
             list_scenes);
  router.add({.method = "GET",
              .pattern = scene,
              .id = "getScene",
              .summary = "One scene and the state of its upload",
              .tag = "scenes",
              .answers = {{200, "the scene", body, headers}},
              .problems = {404}},
             get_scene);
  router.add({.method = "PUT",
              .pattern = scene,
              .role = Role::kSubmit,
              .id = "putScene",
              .summary = "Upload a scene or a part of it",
              .tag = "scenes",
              .headers = {kContentRange, kContentDigest, kReprDigest},
              .body = Content{"application/octet-stream"},
              .is_body_required = false,
              .answers = {{200, "the scene was replaced", body, headers},
                          {201, "the scene was created", body, headers},
                          {202, "the upload is not complete yet", body, headers}},
              .problems = {408, 409, 413, 415}},
             put_scene);
  router.add({.method = "DELETE",
              .pattern = scene,
              .role = Role::kAdmin,
              .id = "deleteScene",
              .summary = "Delete a scene",
              .tag = "scenes",
              .answers = {{204, "deleted"}},
              .problems = {404, 409}},
             delete_scene);
}

}  // namespace voxdag::server
