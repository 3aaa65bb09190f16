#include "server/jobs/protocol/job_request.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <map>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "server/base/json_text.h"
#include "server/base/request_error.h"

namespace voxdag::server {
namespace {

using nlohmann::ordered_json;

constexpr size_t kMaxScenes = 64;
constexpr size_t kMaxTextBytes = 4096;
constexpr size_t kMaxNameCharacters = 200;
constexpr int64_t kMinSubvolume = 64;
constexpr int64_t kMaxResolution = int64_t{1} << 20;
constexpr int64_t kMaxPriority = 100;

[[noreturn]] void fail(const std::string& member, const std::string& expected) {
  throw RequestError(RequestError::Kind::kInvalid, "'" + member + "': expected " + expected);
}

std::string text_of(const ordered_json& value, const std::string& member) {
  if (!value.is_string()) fail(member, "a text");
  const auto& text = value.get_ref<const std::string&>();
  if (text.empty() || text.size() > kMaxTextBytes) fail(member, "1 to 4096 bytes");
  for (const char c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) fail(member, "no control characters");
  return text;
}

// Counts UTF-8 characters: every byte that is no continuation byte.
size_t characters_of(const std::string& text) {
  return static_cast<size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xc0) != 0x80;
  }));
}

std::vector<std::string> texts_of(const ordered_json& value, const std::string& member) {
  if (!value.is_array()) return {text_of(value, member)};
  if (value.empty() || value.size() > kMaxScenes) fail(member, "1 to 64 of them");
  std::vector<std::string> texts;
  for (const ordered_json& item : value) texts.push_back(text_of(item, member));
  return texts;
}

bool flag_of(const ordered_json& value, const std::string& member) {
  if (!value.is_boolean()) fail(member, "true or false");
  return value.get<bool>();
}

double number_of(const ordered_json& value, const std::string& member) {
  if (!value.is_number() || !std::isfinite(value.get<double>())) fail(member, "a finite number");
  return value.get<double>();
}

// A whole number from `min` to `max`; 64.0 is one, too.
int64_t whole_of(const ordered_json& value, const std::string& member, int64_t min, int64_t max) {
  constexpr double kExact = 0x1p53;
  const bool is_whole = value.is_number_unsigned() ? value.get<uint64_t>() <= INT64_MAX
                        : value.is_number_float()
                            ? std::abs(value.get<double>()) <= kExact &&
                                  value.get<double>() == std::floor(value.get<double>())
                            : value.is_number_integer();
  if (!is_whole || value.get<int64_t>() < min || value.get<int64_t>() > max)
    fail(member, "a whole number from " + std::to_string(min) + " to " + std::to_string(max));
  return value.get<int64_t>();
}

uint64_t count_of(const ordered_json& value, const std::string& member, int64_t min, int64_t max) {
  return static_cast<uint64_t>(whole_of(value, member, min, max));
}

int priority_of(const ordered_json& value) {
  return static_cast<int>(whole_of(value, "priority", -kMaxPriority, kMaxPriority));
}

uint64_t power_of_two(const ordered_json& value, const std::string& member, int64_t min) {
  const uint64_t count = count_of(value, member, min, kMaxResolution);
  if (!std::has_single_bit(count)) fail(member, "a power of two");
  return count;
}

uint64_t memory_of(const ordered_json& value) {
  uint64_t bytes = 0;
  if (value.is_string()) {
    try {
      bytes = parse_size(text_of(value, "memory"), "memory");
    } catch (const Error&) {
      fail("memory", "a size such as \"2GiB\", or bytes as a number");
    }
  } else {
    bytes = count_of(value, "memory", 0, INT64_MAX);
  }
  if (bytes < kMinMemory) fail("memory", "at least 64MiB");
  return bytes;
}

std::string one_of(const ordered_json& value, const std::string& member,
                   const std::vector<std::string>& names) {
  std::string text = text_of(value, member), expected;
  for (const std::string& name : names) {
    if (text == name) return text;
    expected += (expected.empty() ? "" : ", ") + name;
  }
  fail(member, "one of " + expected);
}

std::array<double, 4> bounds_of(const ordered_json& value) {
  if (!value.is_array() || value.size() != 4) fail("bounds", "[X, Y, Z, EDGE]");
  std::array<double, 4> bounds{};
  for (size_t i = 0; i < 4; ++i) bounds[i] = number_of(value[i], "bounds");
  if (bounds[3] <= 0) fail("bounds", "an EDGE above 0");
  return bounds;
}

using Readers = std::map<std::string, std::function<void(const ordered_json&)>>;

void read_members(const ordered_json& object, const std::string& where, const Readers& readers) {
  if (!object.is_object()) fail(where, "an object");
  for (const auto& [name, value] : object.items()) {
    const auto reader = readers.find(name);
    if (reader == readers.end()) fail(name.substr(0, 64), "a member that docs/api.md names");
    reader->second(value);
  }
}

void read_options(const ordered_json& options, BuildSpec& spec) {
  GeometryOptions& g = spec.geometry;
  RunOptions& r = spec.run;
  read_members(
      options, "options",
      {{"bounds", [&](const auto& v) { g.bounds = bounds_of(v); }},
       {"voxel_size", [&](const auto& v) { g.voxel_size = number_of(v, "voxel_size"); }},
       {"skip_invalid", [&](const auto& v) { g.skip_invalid = flag_of(v, "skip_invalid"); }},
       {"hash_bits",
        [&](const auto& v) {
          g.hash_bits = static_cast<uint32_t>(count_of(v, "hash_bits", 4, 64));
        }},
       {"color", [&](const auto& v) { g.attributes[Attribute::kColor] |= flag_of(v, "color"); }},
       {"attributes",
        [&](const auto& v) {
          for (const std::string& name : texts_of(v, "attributes"))
            add_attribute(g.attributes,
                          one_of(ordered_json(name), "attributes", AttributeSet::all().names()),
                          "attributes");
        }},
       {"color_resolution",
        [&](const auto& v) { g.color_resolution = power_of_two(v, "color_resolution", 4); }},
       {"memory", [&](const auto& v) { r.memory_bytes = memory_of(v); }},
       {"threads",
        [&](const auto& v) { r.threads = static_cast<unsigned>(count_of(v, "threads", 1, 1024)); }},
       {"subvolume",
        [&](const auto& v) { r.subvolume_edge = power_of_two(v, "subvolume", kMinSubvolume); }},
       {"backend",
        [&](const auto& v) {
          r.backend = one_of(v, "backend", {"auto", "cpu", "cuda", "parallel-host"});
        }},
       {"method", [&](const auto& v) {
          r.method = one_of(v, "method", {"consing", "pointers", "hashes"});
        }}});
  if (g.bounds && g.voxel_size) fail("voxel_size", "no bounds at the same time");
  if (g.color_resolution && !g.attributes.any())
    fail("color_resolution", "color or attributes at the same time");
  if (g.voxel_size && *g.voxel_size <= 0) fail("voxel_size", "a number above 0");
}

}  // namespace

int parse_priority(std::string_view number) {
  return priority_of(ordered_json::parse(number, nullptr, false));
}

JobRequest parse_job_request(std::string_view body) {
  const auto json = ordered_json::parse(body, nullptr, false);
  if (json.is_discarded()) throw RequestError(RequestError::Kind::kInvalid, "the body is not JSON");
  JobRequest request;
  uint64_t& resolution = request.spec.geometry.resolution;
  read_members(
      json, "the body",
      {{"scene", [&](const auto& v) { request.scenes = texts_of(v, "scene"); }},
       {"resolution", [&](const auto& v) { resolution = power_of_two(v, "resolution", 4); }},
       {"name",
        [&](const auto& v) {
          request.name = text_of(v, "name");
          if (characters_of(request.name) > kMaxNameCharacters)
            fail("name", "at most 200 characters");
        }},
       {"priority", [&](const auto& v) { request.priority = priority_of(v); }},
       {"options", [&](const auto& v) { read_options(v, request.spec); }}});
  if (request.scenes.empty()) fail("scene", "a scene");
  if (resolution == 0) fail("resolution", "voxels per edge");
  if (request.spec.geometry.color_resolution > resolution)
    fail("color_resolution", "at most the resolution");
  request.text =
      json_text(ordered_json{{"scene", request.scenes},
                             {"resolution", resolution},
                             {"options", json.value("options", ordered_json::object())}});
  return request;
}

}  // namespace voxdag::server
