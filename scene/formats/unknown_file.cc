#include "scene/formats/unknown_file.h"

#include <string>

#include "scene/formats/formats.h"
#include "scene/messages.h"
#include "scene/text/other_formats.h"

namespace voxdag {
namespace {

// Returns a description of the file for the error message, such as "is empty". `begin` is the
// beginning of the file.
std::string describe(std::string_view begin) {
  if (begin.empty()) return "is empty";
  const std::string known = describe_other_format(begin);
  if (!known.empty()) return known;
  if (without_leading_space(begin).empty()) return "begins with blanks only";
  return "has an unknown format; it begins with " + printable(without_leading_space(begin), 16);
}

std::string list_formats() {
  std::string list;
  for (const SceneFormat& format : scene_formats()) {
    list += (list.empty() ? "" : "; ") + std::string(format.name) + " (";
    for (size_t i = 0; i < format.endings.size(); ++i)
      list += (i > 0 ? ", " : "") + std::string(format.endings[i]);
    list += ")";
  }
  return list;
}

}  // namespace

void refuse_unknown_file(const ReadableFile& file) {
  refuse(file.path(), describe(first_bytes_of(file)) + "; expected a scene: " + list_formats());
}

}  // namespace voxdag
