#include "scene/text/side_files.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "core/base/error.h"
#include "scene/text/characters.h"

namespace voxdag {
namespace {

// True for "/a", "\a", "C:\a" and "http://a".
bool is_absolute(std::string_view name) {
  const size_t end = name.find_first_of(":/\\");
  return end == 0 || (end != name.npos && name[end] == ':');
}

// Removes quotes around a name.
std::string_view unquoted(std::string_view name) {
  name = trimmed(name);
  if (name.size() >= 2 && name.front() == '"' && name.back() == '"')
    return name.substr(1, name.size() - 2);
  return name;
}

// Returns the paths at which the file may be, relative to the folder of the scene file, in order of
// preference.
std::vector<std::string> candidates_of(std::string_view given) {
  const std::string name(unquoted(given));
  std::string with_slashes = name;
  std::ranges::replace(with_slashes, '\\', '/');
  const std::string last = with_slashes.substr(with_slashes.rfind('/') + 1);
  std::vector<std::string> all;
  for (const std::string& candidate : {name, with_slashes, last})
    if (!candidate.empty() && !is_absolute(candidate) && std::ranges::count(all, candidate) == 0)
      all.push_back(candidate);
  return all;
}

}  // namespace

std::unique_ptr<ReadableFile> open_first(FileSystem& files, const std::string& from,
                                         std::span<const std::string> paths) {
  std::optional<Error> first;
  for (const std::string& path : paths) {
    try {
      return files.open_read(parent_directory(from) + "/" + path);
    } catch (const Error& error) {
      if (!first) first = error;
    }
  }
  throw *first;
}

std::unique_ptr<ReadableFile> open_side_file(FileSystem& files, const std::string& from,
                                             std::string_view name) {
  const std::vector<std::string> candidates = candidates_of(name);
  if (candidates.empty() || name.find('\0') != name.npos)
    throw Error(ErrorCode::kInvalidInput,
                "its file name is empty or has a zero byte, expected the name of a file");
  return open_first(files, from, candidates);
}

}  // namespace voxdag
