#include "server/http/message/digest_field.h"

#include <openssl/evp.h>

#include <array>

#include "core/base/text.h"
#include "scene/messages.h"
#include "server/base/request_error.h"
#include "server/http/message/headers.h"

namespace voxdag::server {
namespace {

constexpr size_t kDigestBytes = 32;
constexpr size_t kBase64Chars = 44;

}  // namespace

std::string parse_digest_field(const std::string& header) {
  constexpr std::string_view kName = "sha-256=:";
  std::string_view rest = header;
  while (!rest.empty()) {
    const size_t comma = std::min(rest.find(','), rest.size());
    const std::string_view entry = trimmed(rest.substr(0, comma));
    rest.remove_prefix(std::min(comma + 1, rest.size()));
    if (!entry.starts_with(kName)) continue;  // a different algorithm
    std::array<unsigned char, kDigestBytes + 1> bytes{};
    const std::string_view base64 = entry.substr(kName.size(), kBase64Chars);
    if (entry.size() != kName.size() + kBase64Chars + 1 || !entry.ends_with("=:") ||
        EVP_DecodeBlock(bytes.data(), reinterpret_cast<const unsigned char*>(base64.data()),
                        kBase64Chars) != kDigestBytes + 1)
      throw RequestError(
          RequestError::Kind::kInvalid,
          "the digest '" + printable(entry) + "' is malformed: expected sha-256=:BASE64:");
    return hex_text(std::span(bytes).first(kDigestBytes));
  }
  throw RequestError(
      RequestError::Kind::kInvalid,
      "the digest header '" + printable(header) + "' has no sha-256: expected sha-256=:BASE64:");
}

}  // namespace voxdag::server
