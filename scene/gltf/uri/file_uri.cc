#include "scene/gltf/uri/file_uri.h"

#include <algorithm>
#include <string_view>

#include "core/base/error.h"
#include "core/base/text.h"
#include "scene/gltf/uri/percent.h"
#include "scene/messages.h"
#include "scene/text/side_files.h"

namespace voxdag::gltf {
namespace {

// True if the uri begins with a scheme: "http://...", "file:...", "C:\...".
bool has_scheme(std::string_view uri) {
  const auto is_letter = [](char c) { return (c | 0x20) >= 'a' && (c | 0x20) <= 'z'; };
  const auto is_in_scheme = [&](char c) {
    return is_letter(c) || (c >= '0' && c <= '9') || c == '+' || c == '-' || c == '.';
  };
  const auto end = std::ranges::find_if_not(uri, is_in_scheme);
  return end != uri.end() && *end == ':' && is_letter(uri.front());
}

[[noreturn]] void refuse_uri(const std::string& where, const std::string& what) {
  throw Error(ErrorCode::kInvalidInput, where + ": its uri " + what + ", expected a relative path");
}

}  // namespace

std::vector<std::string> candidate_paths(const std::string& uri, const std::string& where) {
  if (uri.empty()) refuse_uri(where, "is empty");
  if (has_scheme(uri) || uri.front() == '/') refuse_uri(where, "is " + printable(uri));
  if (percent_decoded_leniently(uri).find('\0') != std::string::npos)
    refuse_uri(where, "has a zero byte");
  std::vector<std::string> paths;
  const auto add = [&](std::string path) {
    std::string with_slashes = path;
    std::ranges::replace(with_slashes, '\\', '/');
    for (const std::string& name : {path, with_slashes})
      if (!name.empty() && name.front() != '/' && std::ranges::find(paths, name) == paths.end())
        paths.push_back(name);
  };
  const std::string without_query = uri.substr(0, uri.find_first_of("?#"));
  paths.push_back(percent_decoded_leniently(uri));
  for (const std::string& text : {uri, without_query}) add(percent_decoded_leniently(text));
  for (const std::string& text : {uri, without_query}) add(text);
  return paths;
}

std::unique_ptr<ReadableFile> open_uri(FileSystem& files, const std::string& scene_path,
                                       const std::string& uri, const std::string& where) {
  return open_first(files, scene_path, candidate_paths(uri, where));
}

}  // namespace voxdag::gltf
