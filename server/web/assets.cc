#include "server/web/assets.h"

#include "core/format/checksum.h"

namespace voxdag::server {
namespace {

constexpr size_t kEtagDigits = 32;

std::string type_of(std::string_view name) {
  const std::string_view suffix = name.substr(name.rfind('.') + 1);
  if (suffix == "html") return "text/html; charset=utf-8";
  if (suffix == "css") return "text/css; charset=utf-8";
  if (suffix == "js") return "text/javascript; charset=utf-8";
  return "image/svg+xml";
}

}  // namespace

std::vector<Asset> embedded_assets() {
  std::vector<Asset> assets;
  for (const EmbeddedFile* file = kEmbeddedFiles; file->bytes; ++file) {
    const std::string_view contents(reinterpret_cast<const char*>(file->bytes), file->size);
    assets.push_back({file->name, contents, type_of(file->name),
                      '"' + sha256_hex(contents).substr(0, kEtagDigits) + '"'});
  }
  return assets;
}

}  // namespace voxdag::server
