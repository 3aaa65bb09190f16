#include "server/web/assets.h"

#include <string_view>
#include <utility>

#include "core/format/checksum.h"
#include "scene/formats/formats.h"

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

std::string with_scene_suffixes(std::string contents) {
  constexpr std::string_view kMarker = "{{scene_suffixes}}";
  std::string suffixes = list_scene_endings("|", "|");
  std::erase(suffixes, '.');
  for (size_t at = 0; (at = contents.find(kMarker, at)) != contents.npos; at += suffixes.size())
    contents.replace(at, kMarker.size(), suffixes);
  return contents;
}

std::vector<Asset> make_assets() {
  std::vector<Asset> assets;
  for (const EmbeddedFile* file = kEmbeddedFiles; file->bytes; ++file) {
    std::string contents =
        with_scene_suffixes({reinterpret_cast<const char*>(file->bytes), file->size});
    std::string etag = '"' + sha256_hex(contents).substr(0, kEtagDigits) + '"';
    assets.push_back({file->name, std::move(contents), type_of(file->name), std::move(etag)});
  }
  return assets;
}

}  // namespace

const std::vector<Asset>& embedded_assets() {
  static const std::vector<Asset> assets = make_assets();
  return assets;
}

}  // namespace voxdag::server
