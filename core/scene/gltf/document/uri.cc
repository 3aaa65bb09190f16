#include "core/scene/gltf/document/uri.h"

#include "core/base/error.h"
#include "core/io/file_system.h"

namespace voxdag::gltf {
namespace {

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

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
  std::string path;
  for (size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      path += uri[i];
      continue;
    }
    const int high = i + 2 < uri.size() ? hex_digit(uri[i + 1]) : -1;
    const int low = high >= 0 ? hex_digit(uri[i + 2]) : -1;
    if (low < 0) fail(where, "has a broken percent escape");
    path += static_cast<char>(high * 16 + low);
    i += 2;
  }
  if (path.find('\0') != std::string::npos) fail(where, "has a zero byte");
  return parent_directory(scene_path) + "/" + path;
}

}  // namespace voxdag::gltf
