#include "server/api/routes/tile_routes.h"

#include <algorithm>
#include <bit>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/format/checksum.h"
#include "query/tiles/color_page.h"
#include "query/tiles/tile.h"
#include "server/api/context.h"
#include "server/api/gzip.h"
#include "server/api/public_problem.h"

namespace voxdag::server {
namespace {

// What has a digest in its URL never changes.
constexpr const char* kForEver = "private, max-age=31536000, immutable";
constexpr size_t kTagDigits = 32;
// Of a node above the bricks in any file (docs/format.md).
constexpr uint64_t kMaxLevel = 17, kMaxOffset = (uint64_t{1} << 40) - 1;
// Of the cells of a color page in any file, and of the page's place.
constexpr uint64_t kMaxColorLevel = 20, kMaxPage = (uint64_t{1} << 17) - 1;

static_assert(std::endian::native == std::endian::little, "tiles are sent as they lie in memory");

void append_words(const std::vector<uint32_t>& words, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(words.data()), words.size() * sizeof(uint32_t));
}

std::vector<uint32_t> make_tile(const ViewedFile& file, const query::TileAddress& address) {
  try {
    return query::encode_tile(file.dag(), kTileLevels, address);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound && !error.is_corruption()) throw;
    // Whether the file is damaged, or the offset that of no node, looks the same from here.
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

// LEVEL.OFFSET of a tile. Throws Problem with this status unless a file could have such a node.
query::TileAddress parse_address(const std::string& text, int status) {
  const auto numbers = parse_numbers<uint64_t, 2>(text, '.');
  if (!numbers || (*numbers)[0] > kMaxLevel || (*numbers)[1] > kMaxOffset)
    throw problem(status == 404 ? ErrorCode::kNotFound : ErrorCode::kInvalidInput,
                  "expected the level and the word offset of a node");
  return {static_cast<uint32_t>((*numbers)[0]), (*numbers)[1]};
}

// LEVEL.X.Y.Z of a color page.
query::ColorPageAddress parse_page(const std::string& text) {
  const auto numbers = parse_numbers<uint64_t, 4>(text, '.');
  if (!numbers || (*numbers)[0] > kMaxColorLevel ||
      std::any_of(numbers->begin() + 1, numbers->end(), [](uint64_t c) { return c > kMaxPage; }))
    throw bad_request("'pages': expected the level and the place of each page, LEVEL.X.Y.Z");
  const auto& [level, x, y, z] = *numbers;
  return {static_cast<uint32_t>(level), {x, y, z}};
}

// The addresses of a list, of which `name` is the parameter.
template <class Parse>
auto parse_batch(const std::string& name, std::string_view list, size_t most, const Parse& parse) {
  std::vector<decltype(parse(std::string()))> addresses;
  for (size_t comma;; list.remove_prefix(comma + 1)) {
    if (addresses.size() == most)
      throw bad_request("'" + name + "': expected at most " + std::to_string(most));
    comma = list.find(',');
    addresses.push_back(parse(std::string(list.substr(0, comma))));
    if (comma == std::string_view::npos) return addresses;
  }
}

void check_digest(const Call& call, const ViewedFile& file) {
  const std::string digest = call.query("v");
  if (digest.size() != file.digest().size() ||
      digest.find_first_not_of("0123456789abcdef") != std::string::npos)
    throw bad_request("'v': expected the digest of the manifest, 32 hex digits");
  if (digest != file.digest())
    throw Problem(410, "gone",
                  "the file was replaced, or its tiles are made otherwise now: get the manifest");
}

// `make` returns the bytes of the answer. They depend on nothing but the digest and what the
// request names, which are the entity tag.
template <class Make>
Response answer_for_ever(const Call& call, const ViewedFile& file, const std::string& name,
                         const Make& make) {
  check_digest(call, file);
  Response response = make_response(200, "application/octet-stream", kForEver);
  const std::string tag = sha256_hex(file.digest() + ' ' + name).substr(0, kTagDigits);
  response.headers.emplace("ETag", "W/\"" + tag + '"');
  response.headers.emplace("Vary", "Accept-Encoding, Authorization");
  const std::string known = call.request.header("If-None-Match");
  // Whether there is such a tile at all, which "*" asks for, is not known before it is made.
  if (trimmed(known) != "*" && has_tag(known, '"' + tag + '"')) {
    response.status = 304;
    return response;
  }
  response.body = make();
  return response;
}

// An answer, or an error, that comes from zeros in place of what cannot be read is none.
template <class Answer>
Response answer_of_whole(const Call& call, const ViewedFile& file, const Answer& answer) {
  file.expect_whole();  // what is damaged already is not read again
  try {
    Response response = answer(call, file);
    file.expect_whole();
    return response;
  } catch (...) {
    file.expect_whole();
    throw;
  }
}

Response get_manifest(const Call&, const ViewedFile& file) {
  return json_response(200, file.manifest());
}

Response get_tile(const Call& call, const ViewedFile& file) {
  const std::string name = *(call.names.end() - 2) + '.' + call.names.back();
  const query::TileAddress address = parse_address(name, 404);
  return answer_for_ever(call, file, name, [&] {
    std::string bytes;
    append_words(make_tile(file, address), bytes);
    return bytes;
  });
}

// What `make` returns for each of the addresses, after its length in bytes.
template <class Addresses, class Make>
std::string batch_of(const Addresses& addresses, const Make& make) {
  std::string bytes;
  for (const auto& address : addresses) {
    const std::vector<uint32_t> words = make(address);
    append_words({static_cast<uint32_t>(words.size() * sizeof(uint32_t))}, bytes);
    append_words(words, bytes);
  }
  return bytes;
}

Response get_batch(const Call& call, const ViewedFile& file) {
  const std::string nodes = call.query("nodes");
  const auto addresses = parse_batch("nodes", nodes, kMaxTilesOfBatch, [](const std::string& text) {
    return parse_address(text, 400);
  });
  return answer_for_ever(call, file, "batch " + nodes, [&] {
    return batch_of(addresses, [&](const auto& address) { return make_tile(file, address); });
  });
}

Response get_colors(const Call& call, const ViewedFile& file) {
  const std::string pages = call.query("pages");
  const auto addresses = parse_batch("pages", pages, kMaxColorPagesOfBatch, parse_page);
  return answer_for_ever(call, file, "colors " + pages, [&] {
    query::ColorPages pages_of_file(file.file(), file.dag());
    return batch_of(addresses,
                    [&](const auto& address) { return make_page(pages_of_file, address); });
  });
}

Viewed result_of_job(Context& context, const Call& call) {
  const Job job = find_job(context.queue, call.names[0]);
  if (job.state != JobState::kSucceeded) {
    Problem problem = conflict("the job has no result yet: expected a succeeded job");
    problem.state = state_name(job.state);
    throw problem;
  }
  auto permit = context.tiles.acquire(call.caller.client);
  if (!permit) throw busy("too many requests for tiles at a time, of this client or of all", 1);
  return {context.viewed.open(context.dispatcher.folder(job.id).result()), std::move(permit)};
}

// What a job that has not succeeded has built so far.
Response get_partial(Context& context, Call& call) {
  const Job job = find_job(context.queue, call.names[0]);
  if (job.state == JobState::kSucceeded)
    throw not_found("the job has its result: expected one that has not succeeded");
  auto permit = context.tiles.acquire(call.caller.client);
  if (!permit) throw busy("too many requests for tiles at a time, of this client or of all", 1);
  const uint64_t resolution = nlohmann::json::parse(job.request).at("resolution");
  try {
    Response response = json_response(
        200, context.partial.json(job.id, context.dispatcher.folder(job.id).work(), resolution));
    pack(call.request, response);
    response.permit = std::move(permit);
    return response;
  } catch (const Error& error) {
    // A store that is just being made has no tables yet.
    if (!error.is_corruption() && error.code() != ErrorCode::kInvalidInput) throw;
    throw not_found("nothing is known of what the job has built");
  }
}

}  // namespace

void add_tile_routes(Router& router, const std::string& base, Packing packing,
                     const FindViewedFile& find) {
  const auto add = [&](const std::string& path, auto answer, const QueryNames& query) {
    const auto handler = [find, answer, packing](Call& call) {
      Viewed viewed = find(call);
      Response response = answer_of_whole(call, *viewed.file, answer);
      if (packing == Packing::kGzip) pack(call.request, response);
      response.permit = std::move(viewed.permit);
      return response;
    };
    router.add("GET", base + path, Role::kRead, handler, query);
  };
  add("/tiles", get_manifest, {});
  add("/tiles/batch", get_batch, {"v", "nodes"});
  add("/tiles/colors", get_colors, {"v", "pages"});
  add("/tiles/{level}/{offset}", get_tile, {"v"});
}

void add_job_tile_routes(Router& router) {
  const auto find = [&context = router.context()](const Call& call) {
    return result_of_job(context, call);
  };
  add_tile_routes(router, "/api/v1/jobs/{id}", Packing::kGzip, find);
  router.add("GET", "/api/v1/jobs/{id}/partial", Role::kRead, get_partial);
}

}  // namespace voxdag::server
