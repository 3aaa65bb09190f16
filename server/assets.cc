#include "server/assets.h"

#include "core/format/checksum.h"

namespace voxdag::server {
namespace {

std::string type_of(std::string_view name) {
  const std::string_view suffix = name.substr(name.rfind('.') + 1);
  if (suffix == "html") return "text/html; charset=utf-8";
  if (suffix == "css") return "text/css; charset=utf-8";
  if (suffix == "js") return "text/javascript; charset=utf-8";
  if (suffix == "svg") return "image/svg+xml";
  return "application/json";
}

}  // namespace

std::optional<Asset> find_asset(std::string_view name) {
  for (const EmbeddedFile* file = kEmbeddedFiles; file->bytes; ++file) {
    if (name != file->name) continue;
    const std::string_view contents(reinterpret_cast<const char*>(file->bytes), file->size);
    return Asset{contents, type_of(name), '"' + sha256_hex(contents).substr(0, 32) + '"'};
  }
  return {};
}

}  // namespace voxdag::server
