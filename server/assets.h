// Files that are compiled into the program: the dashboard's and openapi.json (see embed.cmake).
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace voxdag::server {

struct EmbeddedFile {
  const char* name;
  const unsigned char* bytes;
  size_t size;
};
// The last one has no name and no bytes.
extern const EmbeddedFile kEmbeddedFiles[];

struct Asset {
  std::string_view contents;
  std::string type;  // for Content-Type
  std::string etag;
};
// No value for an unknown name.
std::optional<Asset> find_asset(std::string_view name);

}  // namespace voxdag::server
