// The files of the dashboard, which are compiled into the program (embed.cmake). In these files,
// the marker "{{scene_suffixes}}" is replaced by the file name endings of the scene formats, such
// as "glb|gltf|ply".
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace voxdag::server {

struct EmbeddedFile {
  const char* name;  // "app.js", "lib/api.js"
  const unsigned char* bytes;
  size_t size;
};
// The last entry has no bytes (nullptr). Defined in the generated embedded_files.cc.
extern const EmbeddedFile kEmbeddedFiles[];

struct Asset {
  std::string name;  // URL path without the leading slash
  std::string contents;
  std::string type;  // value of Content-Type
  std::string etag;  // in quotes
};
const std::vector<Asset>& embedded_assets();

}  // namespace voxdag::server
