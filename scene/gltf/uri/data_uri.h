// data: URIs (RFC 2397), base64 or percent-encoded, also in forms that some programs write although
// the RFC does not allow them.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace voxdag::gltf {

// True if the text begins with "data:", in upper or lower case.
bool is_data_uri(std::string_view text);

struct DataUri {
  size_t begin = 0;        // position of the data, after the comma
  bool is_base64 = false;  // otherwise the data are percent-encoded
};

// Parses the part of a data: URI before the data. Returns nullopt if there is no comma.
std::optional<DataUri> parse_data_uri(std::string_view text);

// True if the characters contain white space, percent escapes, or characters of the URL-safe
// alphabet. decode_base64() in scene/base64.h cannot decode such characters. decode_data() can
// decode them if they are otherwise valid base64.
bool has_unusual_base64(std::span<const char> characters);

// Decodes all data of a data: URI. Base64 may contain white space and percent escapes, use the
// URL-safe alphabet and lack padding. Returns nullopt if the data are not base64.
std::optional<std::string> decode_data(std::string_view data, bool is_base64);

}  // namespace voxdag::gltf
