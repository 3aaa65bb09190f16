#include "scene/messages.h"

#include <algorithm>

#include "core/base/error.h"

namespace voxdag {

namespace {

// Returns the number of bytes of the UTF-8 character at the beginning of `text`; 0 if there is
// none.
size_t utf8_bytes(std::string_view text) {
  const auto first = static_cast<unsigned char>(text[0]);
  const size_t bytes = first < 0x80   ? 1
                       : first < 0xc2 ? 0
                       : first < 0xe0 ? 2
                       : first < 0xf0 ? 3
                                      : 4;
  if (first > 0xf4 || text.size() < bytes) return 0;
  for (size_t i = 1; i < bytes; ++i)
    if ((static_cast<unsigned char>(text[i]) & 0xc0) != 0x80) return 0;
  return bytes;
}

bool is_control_character(std::string_view character) {
  const auto last = static_cast<unsigned char>(character.back());
  return character.size() == 1 ? last < 0x20 || last == 0x7f
                               : character[0] == '\xc2' && last < 0xa0;
}

}  // namespace

std::string printable(std::string_view text, size_t max_bytes) {
  std::string shown;
  std::string_view rest = text.substr(0, max_bytes);
  while (!rest.empty()) {
    const size_t bytes = utf8_bytes(rest);
    const std::string_view character = rest.substr(0, bytes);
    const bool is_shown = bytes > 0 && character != "\"" && !is_control_character(character);
    shown += is_shown ? character : "?";
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

void refuse(const std::string& path, const std::string& what) {
  throw Error(ErrorCode::kInvalidInput, path + ": " + what);
}

}  // namespace voxdag
