#include "server/api/routes/tile_routes.h"

#include <algorithm>
#include <bit>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/fields/json_text.h"
#include "core/format/checksum.h"
#include "query/tiles/color_page.h"
#include "query/tiles/tile.h"
#include "scene/messages.h"
#include "server/api/answers/gzip.h"
#include "server/api/answers/public_problem.h"
#include "server/api/context/context.h"
#include "server/api/routes/download.h"

namespace voxdag::server {
namespace {

// Value of Cache-Control for URLs with a digest. The contents of such a URL never change.
constexpr const char* kImmutable = "private, max-age=31536000, immutable";
constexpr size_t kTagDigits = 32;
// Limits for the address of a node above the bricks (docs/format.md).
constexpr uint64_t kMaxLevel = 17, kMaxOffset = (uint64_t{1} << 40) - 1;
// An answer of at least this many bytes holds its permit until it is sent. So a client with many
// large answers uses up its own permits and delays only itself. A smaller answer releases its
// permit before it is sent. So a client with a slow link does not delay other clients with the same
// token.
constexpr size_t kLargeAnswer = 512 << 10;
// Limits for the level of a color page, and for its position.
constexpr uint64_t kMaxColorLevel = 20, kMaxPage = (uint64_t{1} << 17) - 1;

const Parameter kDigest = {"v", "digest of the manifest", "^[0-9a-f]{32}$", {}, true};
const Parameter kNodes = {"nodes",
                          "LEVEL.OFFSET of each tile, separated by commas",
                          "^[0-9]{1,2}\\.[0-9]{1,13}(,[0-9]{1,2}\\.[0-9]{1,13}){0," +
                              std::to_string(kMaxTilesOfBatch - 1) + "}$",
                          {},
                          true};
const Parameter kPages = {"pages",
                          "LEVEL.X.Y.Z of each page, separated by commas",
                          "^[0-9]{1,2}(\\.[0-9]{1,6}){3}(,[0-9]{1,2}(\\.[0-9]{1,6}){3}){0," +
                              std::to_string(kMaxColorPagesOfBatch - 1) + "}$",
                          {},
                          true};

static_assert(std::endian::native == std::endian::little, "tiles are sent in their memory layout");

void append_words(const std::vector<uint32_t>& words, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(words.data()), words.size() * sizeof(uint32_t));
}

std::vector<uint32_t> make_tile(const TileSource& dag, const query::TileAddress& address) {
  try {
    return query::encode_tile(dag.dag(), kTileLevels, address, dag.blocks());
  } catch (const DamagedBlock&) {
    throw;
  } catch (const Error& error) {
    if (!error.is_corruption()) throw;
    // Damage of the file causes an exception of another type, DamagedBlock. So this error means
    // that no node is at the offset.
    throw not_found(error.message());
  }
}

std::vector<uint32_t> make_page(query::ColorPages& pages, const query::ColorPageAddress& address) {
  try {
    return pages.encode(address);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound) throw;
    throw not_found(error.message());
  }
}

// Parses the address LEVEL.OFFSET of a tile. Throws Problem with `status` if no file can have a
// node at this address.
query::TileAddress parse_address(const std::string& text, int status) {
  const auto numbers = parse_numbers<uint64_t, 2>(text, '.');
  if (!numbers || (*numbers)[0] > kMaxLevel || (*numbers)[1] > kMaxOffset)
    throw problem(status == 404 ? ErrorCode::kNotFound : ErrorCode::kInvalidInput,
                  "tile '" + printable(text) + "': expected LEVEL.OFFSET, with a level from 0 to " +
                      std::to_string(kMaxLevel) + " and the word offset of a node");
  return {static_cast<uint32_t>((*numbers)[0]), (*numbers)[1]};
}

// Parses the address LEVEL.X.Y.Z of a color page.
query::ColorPageAddress parse_page(const std::string& text) {
  const auto numbers = parse_numbers<uint64_t, 4>(text, '.');
  if (!numbers || (*numbers)[0] > kMaxColorLevel ||
      std::any_of(numbers->begin() + 1, numbers->end(), [](uint64_t c) { return c > kMaxPage; }))
    throw bad_request(
        "page '" + printable(text) + "' of 'pages': expected LEVEL.X.Y.Z, with a level from 0 to " +
        std::to_string(kMaxColorLevel) + " and the position of a page, three numbers from 0 to " +
        std::to_string(kMaxPage));
  const auto& [level, x, y, z] = *numbers;
  return {static_cast<uint32_t>(level), {x, y, z}};
}

// Parses the comma-separated addresses in `list`, the value of the query parameter `name`. Throws
// Problem (400) if there are more than `most` addresses.
template <class Parse>
auto parse_batch(const std::string& name, std::string_view list, size_t most, const Parse& parse) {
  std::vector<decltype(parse(std::string()))> addresses;
  for (size_t comma;; list.remove_prefix(comma + 1)) {
    if (addresses.size() == most)
      throw bad_request("'" + name + "' has too many addresses: expected at most " +
                        std::to_string(most));
    comma = list.find(',');
    addresses.push_back(parse(std::string(list.substr(0, comma))));
    if (comma == std::string_view::npos) return addresses;
  }
}

void check_digest(const Call& call, const TileSource& dag) {
  const std::string digest = call.query("v");
  if (digest.size() != dag.digest().size() ||
      digest.find_first_not_of("0123456789abcdef") != std::string::npos)
    throw bad_request("'v' is '" + printable(digest) +
                      "': expected the digest of the manifest, 32 hex digits");
  if (digest != dag.digest())
    throw Problem(410, "gone",
                  "the file or the format of its tiles has changed: get the manifest again");
}

// Returns a response that clients may cache forever. make() returns the bytes of the response,
// which depend only on the digest and `name`. The entity tag is a hash of the digest and `name`.
template <class Make>
Response immutable_response(const Call& call, const TileSource& dag, const std::string& name,
                            const Make& make) {
  check_digest(call, dag);
  Response response = make_response(200, "application/octet-stream", kImmutable);
  const std::string tag = sha256_hex(dag.digest() + ' ' + name).substr(0, kTagDigits);
  response.headers.emplace("ETag", "W/\"" + tag + '"');
  response.headers.emplace("Vary", "Accept-Encoding, Authorization");
  const std::string known = call.request.header("If-None-Match");
  // For the value "*", which matches every existing tile, the answer is the tile instead of 304.
  // The service would have to make the tile to find out whether it exists.
  if (trimmed(known) != "*" && has_tag(known, '"' + tag + '"')) {
    response.status = 304;
    return response;
  }
  response.body = make();
  return response;
}

// Returns the problem that is sent to clients. The problem's text omits the error's message,
// because the message contains the name of the file. The service logs the message of the first
// damage.
Problem damaged(const TileSource& dag, const Audience& audience, const Error& error) {
  const std::string verify = audience.spell_command("verify", "", "");
  Problem result =
      problem(ErrorCode::kCorrupt,
              "the requested part of the DAG or of its colors is damaged: " +
                  (verify.empty() ? "submit a new job of the scene"
                                  : "run '" + verify + "' on the file, and build it again"));
  if (dag.is_first_damage()) result.log_text = error.message();
  return result;
}

void expect_unchanged(const TileSource& dag) {
  // An overwritten file can also be unreadable, because it was truncated first.
  if (dag.was_overwritten())
    throw Problem(410, "gone", "the file was replaced while being read: get the manifest again");
  dag.expect_readable();
}

// Calls `answer`. If the file was readable and unchanged during the call, returns the response of
// `answer` or throws its error. Otherwise this result is meaningless, and the function throws
// another error. (Unreadable pages read as zeros, and a file that is being overwritten mixes old
// and new parts.)
template <class Answer>
Response consistent_response(const Call& call, const TileSource& dag, const Audience& audience,
                             const Answer& answer) {
  dag.expect_readable();  // a file known to be damaged is not read again
  try {
    Response response = answer(call, dag);
    expect_unchanged(dag);
    return response;
  } catch (const Error& error) {
    expect_unchanged(dag);
    if (error.code() == ErrorCode::kCorrupt) throw damaged(dag, audience, error);
    throw;
  } catch (...) {
    expect_unchanged(dag);
    throw;
  }
}

// Returns the JSON object `manifest` with the additional member "name". Returns it unchanged if
// `name` is "".
std::string with_name(const std::string& manifest, const std::string& name) {
  if (name.empty()) return manifest;
  return "{\"name\":" + exact_json_text(nlohmann::json(printable_line(name))) + "," +
         manifest.substr(1);
}

Response get_manifest(const TileSource& dag, const std::string& name, const CancelToken& stopping) {
  try {
    return json_response(200, with_name(dag.manifest(stopping), name));
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCanceled) throw;
    throw busy("the service is stopping: expected a request after its restart");
  }
}

Response get_tile(const Call& call, const TileSource& dag) {
  const std::string name = *(call.names.end() - 2) + '.' + call.names.back();
  const query::TileAddress address = parse_address(name, 404);
  return immutable_response(call, dag, name, [&] {
    std::string bytes;
    append_words(make_tile(dag, address), bytes);
    return bytes;
  });
}

// Calls make(address) for each address, and returns all results, each preceded by its length in
// bytes. Disks can be slow, so the function throws as soon as the client has disconnected. A
// stopping service closes all connections, so it also ends this function.
template <class Addresses, class Make>
std::string batch_of(const Call& call, const Addresses& addresses, const Make& make) {
  std::string bytes;
  for (const auto& address : addresses) {
    if (call.request.client_has_left())
      throw bad_request("the client has closed the connection: expected it to wait for the tiles");
    const std::vector<uint32_t> words = make(address);
    append_words({static_cast<uint32_t>(words.size() * sizeof(uint32_t))}, bytes);
    append_words(words, bytes);
  }
  return bytes;
}

Response get_batch(const Call& call, const TileSource& dag) {
  const std::string nodes = call.query("nodes");
  const auto addresses = parse_batch("nodes", nodes, kMaxTilesOfBatch, [](const std::string& text) {
    return parse_address(text, 400);
  });
  return immutable_response(call, dag, "batch " + nodes, [&] {
    return batch_of(call, addresses, [&](const auto& address) { return make_tile(dag, address); });
  });
}

Response get_colors(const Call& call, const TileSource& dag) {
  const std::string pages = call.query("pages");
  const auto addresses = parse_batch("pages", pages, kMaxColorPagesOfBatch, parse_page);
  return immutable_response(call, dag, "colors " + pages, [&] {
    if (!dag.colored_file())
      throw not_found("the DAG has no colors: expected a DAG built with colors");
    query::ColorPages pages_of_file(*dag.colored_file(), dag.dag(), dag.blocks());
    return batch_of(call, addresses,
                    [&](const auto& address) { return make_page(pages_of_file, address); });
  });
}

std::shared_ptr<void> tile_permit(Context& context, const Call& call) {
  auto permit = context.tiles.acquire(call.caller.client);
  if (!permit) throw busy("too many concurrent requests for tiles: " + context.tiles.limits(), 1);
  return permit;
}

void hold_permit(std::shared_ptr<void> permit, Response& response) {
  (response.body.size() >= kLargeAnswer ? response.permit : response.build_permit) =
      std::move(permit);
}

TileAccess open_result(Context& context, const Call& call) {
  const Job job = find_job(context.queue, call.names[0]);
  if (job.state != JobState::kSucceeded) {
    Problem problem = conflict(std::string("the job is ") + state_name(job.state) +
                               " and has no result: expected a succeeded job");
    problem.state = state_name(job.state);
    throw problem;
  }
  auto permit = tile_permit(context, call);
  auto file = open_kept(job.id, "the result", kNewJobAdvice, [&] {
    return context.open_sources.open(context.dispatcher.folder(job.id).result());
  });
  return {std::move(file), std::move(permit)};
}

// Returns make(id, folder, resolution) for the job of the call. Throws Problem (404) if the job has
// succeeded, or if its subvolumes are not known yet.
template <class Make>
auto with_unfinished_job(Context& context, const Call& call, const Make& make) {
  const Job job = find_job(context.queue, call.names[0]);
  if (job.state == JobState::kSucceeded)
    throw not_found("the job has succeeded: expected an unfinished job");
  const uint64_t resolution = parse_json<nlohmann::json>(job.request).at("resolution");
  try {
    return make(job.id, context.dispatcher.folder(job.id), resolution);
  } catch (const Error& error) {
    // Errors are expected in two cases: a new store has no tables yet, and a job that ends removes
    // its store, perhaps during this read.
    const bool is_read = find_job(context.queue, call.names[0]).state != JobState::kSucceeded;
    if (is_read && !error.is_corruption() && error.code() != ErrorCode::kInvalidInput) throw;
    throw not_found(
        "the subvolumes of the job are not known yet: expected a job that has read its scene");
  }
}

Response get_partial(Context& context, Call& call) {
  auto permit = tile_permit(context, call);
  Response response = json_response(
      200, with_unfinished_job(context, call, [&](const auto& id, const auto& folder, uint64_t r) {
        return context.partial.json(id, folder, r);
      }));
  pack(call.request, response);
  hold_permit(std::move(permit), response);
  return response;
}

TileAccess open_unfinished_job(Context& context, const Call& call) {
  auto permit = tile_permit(context, call);
  // Tiles of the requested version are still served after the job has ended, so that viewers can
  // finish loading them.
  auto dag = context.partial.known(find_job(context.queue, call.names[0]).id, call.query("v"));
  if (!dag)
    dag = with_unfinished_job(context, call, [&](const auto& id, const auto& folder, uint64_t r) {
      return context.partial.tiles(id, folder, r);
    });
  return {std::move(dag), std::move(permit)};
}

}  // namespace

void add_tile_routes(Router& router, const TileRoutes& routes, const OpenTiles& open,
                     const CancelToken& stopping) {
  const auto add = [&](const std::string& path, const std::string& id, const std::string& summary,
                       const std::vector<Parameter>& query, const std::vector<Answer>& answers,
                       auto answer) {
    router.add({.method = "GET",
                .pattern = routes.base + path,
                .id = "get" + routes.id + id,
                .summary = routes.subject + summary,
                .tag = "results",
                .query = query,
                .answers = answers,
                .problems = {404, 409, 410}},
               [open, answer, packing = routes.packing, audience = routes.audience](Call& call) {
                 TileAccess access = open(call);
                 Response response = consistent_response(call, *access.dag, *audience, answer);
                 if (packing == Packing::kGzip) pack(call.request, response);
                 hold_permit(std::move(access.permit), response);
                 return response;
               });
  };
  const std::vector<Answer> tiles = {{200,
                                      "docs/format.md, Tiles",
                                      {{"application/octet-stream"}},
                                      {{"ETag", "a tag of the contents of this URL"}}},
                                     {304, "the client has it"}};
  add("/tiles", "Tiles", "grid, cameras, and how tiles are addressed", {},
      {{200, "the manifest", {json_content(routes.manifest_schema)}}},
      [&stopping, name = routes.file_name](const Call&, const TileSource& dag) {
        return get_manifest(dag, name, stopping);
      });
  add("/tiles/batch", "TileBatch", "several tiles, each after its length in bytes",
      {kDigest, kNodes}, tiles, get_batch);
  if (routes.colors == Colors::kServed)
    add("/tiles/colors", "ColorPages",
        "colors of cubes of 8 x 8 x 8 cells, each after its length in bytes", {kDigest, kPages},
        tiles, get_colors);
  add("/tiles/{level}/{offset}", "Tile", "a node and a few levels below it", {kDigest}, tiles,
      get_tile);
}

void add_job_tile_routes(Router& router) {
  const auto finder = [&context = router.context()](auto find) {
    return [&context, find](const Call& call) { return find(context, call); };
  };
  const std::string job = "/api/v1/jobs/{id}";
  const CancelToken& stopping = router.context().stopping;
  add_tile_routes(
      router, {.base = job, .id = "", .subject = "The result: ", .manifest_schema = "TileManifest"},
      finder(open_result), stopping);
  add_tile_routes(router,
                  {.base = job + "/partial",
                   .id = "Partial",
                   .subject = "A job that has not succeeded: ",
                   .manifest_schema = "PartialManifest",
                   .colors = Colors::kNone},
                  finder(open_unfinished_job), stopping);
  router.add({.method = "GET",
              .pattern = job + "/partial",
              .id = "getPartial",
              .summary = "The subvolumes that a job has built so far, coarsely",
              .tag = "results",
              .answers = {{200,
                           "built subvolumes in voxels, each with a coarse brick",
                           {json_content("Partial")}}},
              .problems = {404}},
             get_partial);
}

}  // namespace voxdag::server
