#include "core/io/random_id.h"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <system_error>

#include "core/base/text.h"

namespace voxdag {

std::string random_id() {
  std::array<unsigned char, 8> bytes{};
  if (getentropy(bytes.data(), bytes.size()) != 0)
    throw std::system_error(errno, std::generic_category(), "getentropy");
  return hex_text(bytes);
}

bool is_random_id(std::string_view text) {
  return text.size() == 16 && text.find_first_not_of("0123456789abcdef") == text.npos;
}

}  // namespace voxdag
