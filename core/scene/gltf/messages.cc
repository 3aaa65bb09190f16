#include "core/scene/gltf/messages.h"

#include "core/base/error.h"

namespace voxdag::gltf {

std::string printable(std::string_view text, size_t max_bytes) {
  std::string shown(text.substr(0, max_bytes));
  for (char& c : shown)
    if (static_cast<unsigned char>(c) < 0x20 || c == '"' || c == 0x7f) c = '?';
  return text.size() > max_bytes ? shown + "..." : shown;
}

std::string numbered(int index, const std::string& name) {
  const std::string number = std::to_string(index);
  return name.empty() ? number : number + " \"" + printable(name) + "\"";
}

void refuse(const std::string& path, const std::string& what) {
  throw Error(ErrorCode::kInvalidInput, path + ": " + what);
}

}  // namespace voxdag::gltf
