#include "core/base/text/percent.h"

#include "core/base/text.h"

namespace voxdag {

std::string percent_encoded(std::string_view text) {
  constexpr std::string_view kUnreserved =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~";
  std::string encoded;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (kUnreserved.find(c) != std::string_view::npos)
      encoded += c;
    else
      encoded += '%' + hex_text({&byte, 1});
  }
  return encoded;
}

}  // namespace voxdag
