#include "scene/gltf/uri/data_uri.h"

#include <algorithm>

#include "scene/base64.h"
#include "scene/gltf/uri/percent.h"
#include "scene/text/characters.h"

namespace voxdag::gltf {
namespace {

constexpr std::string_view kBlanks = " \t\r\n\f\v";

std::string_view trimmed(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  return text.substr(0, text.find_last_not_of(kBlanks) + 1);
}

// Rewrites base64 to the standard alphabet, without blanks and padding.
void normalize(std::string& base64) {
  std::erase_if(base64, [](char c) { return kBlanks.find(c) != kBlanks.npos; });
  std::ranges::replace(base64, '-', '+');
  std::ranges::replace(base64, '_', '/');
  base64.resize(base64.find_last_not_of('=') + 1);
}

}  // namespace

bool is_data_uri(std::string_view text) { return equals_in_any_case(text.substr(0, 5), "data:"); }

std::optional<DataUri> parse_data_uri(std::string_view text) {
  const size_t comma = text.find(',');
  if (comma == text.npos) return {};
  const std::string_view parameters = text.substr(0, comma);
  const size_t last = parameters.find_last_of(';');
  return DataUri{comma + 1, last != parameters.npos &&
                                equals_in_any_case(trimmed(parameters.substr(last + 1)), "base64")};
}

bool has_unusual_base64(std::span<const char> characters) {
  bool is_unusual = false;
  for (const char c : characters) is_unusual |= (c <= ' ') | (c == '%') | (c == '-') | (c == '_');
  return is_unusual;
}

std::optional<std::string> decode_data(std::string_view data, bool is_base64) {
  std::string text = percent_decoded_leniently(data);
  if (!is_base64) return text;
  normalize(text);
  if (text.size() % 4 == 1 || text.find('=') != text.npos) return {};
  std::string bytes((text.size() + 3) / 4 * 3, '\0');
  constexpr size_t kPart = size_t{1} << 20;  // characters per step; a multiple of four
  for (size_t at = 0; at < text.size(); at += kPart) {
    const std::string_view part = std::string_view(text).substr(at, kPart);
    if (!voxdag::decode_base64(std::as_bytes(std::span(part)),
                               reinterpret_cast<std::byte*>(bytes.data() + at / 4 * 3)))
      return {};
  }
  bytes.resize(base64_bytes(text.size(), {}));
  return bytes;
}

}  // namespace voxdag::gltf
