#include "scene/messages.h"

#include "core/base/error.h"

namespace voxdag {

std::string printable(std::string_view text, size_t max_bytes) {
  std::string shown(text.substr(0, max_bytes));
  for (size_t i = 0; i < shown.size(); ++i) {
    const auto byte = [&](size_t at) { return static_cast<unsigned char>(shown[at]); };
    const bool is_c1 = i > 0 && byte(i - 1) == 0xc2 && byte(i) >= 0x80 && byte(i) < 0xa0;
    if (is_c1) shown[i - 1] = '?';
    if (is_c1 || byte(i) < 0x20 || shown[i] == '"' || byte(i) == 0x7f) shown[i] = '?';
  }
  return text.size() > max_bytes ? shown + "..." : shown;
}

std::string without_prefix(std::string message) {
  if (message.starts_with("[json.exception")) message.erase(0, message.find("] ") + 2);
  return message;
}

std::string numbered(int index, const std::string& name) {
  const std::string number = std::to_string(index);
  return name.empty() ? number : number + " \"" + printable(name) + "\"";
}

void refuse(const std::string& path, const std::string& what) {
  throw Error(ErrorCode::kInvalidInput, path + ": " + what);
}

}  // namespace voxdag
