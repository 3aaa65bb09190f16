#include "scene/messages.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text/printable.h"

namespace voxdag {

std::string printable(std::string_view text, size_t max_bytes) {
  std::string shown;
  std::string_view rest = text.substr(0, max_bytes);
  while (!rest.empty()) {
    const size_t bytes = printable_bytes(rest);
    const std::string_view character = rest.substr(0, bytes);
    shown += bytes > 0 && character != "\"" ? character : "?";
    rest.remove_prefix(std::max<size_t>(bytes, 1));
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

std::string not_finite() {
  return " is not a finite position, expected finite coordinates (" + option_text("skip_invalid") +
         " drops these triangles)";
}

void refuse(const std::string& path, const std::string& what) {
  throw Error(ErrorCode::kInvalidInput, path + ": " + what);
}

}  // namespace voxdag
