#include "core/scene/gltf/document/uri.h"

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/io/file_system.h"

namespace voxdag::gltf {
namespace {

// A colon before the first slash: "http://...", "file:...", "C:\...".
bool has_scheme(const std::string& uri) {
  const size_t end = uri.find_first_of(":/");
  return end != std::string::npos && uri[end] == ':';
}

[[noreturn]] void fail(const std::string& where, const char* what) {
  throw Error(ErrorCode::kInvalidInput, where + ": its uri " + what);
}

}  // namespace

std::string resolve_uri(const std::string& scene_path, const std::string& uri,
                        const std::string& where) {
  if (uri.empty()) fail(where, "is empty");
  if (has_scheme(uri) || uri[0] == '/') fail(where, "is not a relative path");
  const auto path = percent_decoded(uri);
  if (!path) fail(where, "has a broken percent escape");
  if (path->find('\0') != std::string::npos) fail(where, "has a zero byte");
  return parent_directory(scene_path) + "/" + *path;
}

}  // namespace voxdag::gltf
