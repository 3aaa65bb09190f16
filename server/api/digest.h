// SHA-256 in the forms that requests and answers use.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace voxdag::server {

// 64 lower-case hex digits.
std::string sha256_hex(std::string_view text);
// "sha-256=:BASE64:" (RFC 9530) of a digest in hex.
std::string digest_field(const std::string& sha256);
// The SHA-256 of a Content-Digest or Repr-Digest header in hex. Throws Problem (400) for one that
// is broken or has other algorithms only: what a client asks to be checked is not passed over.
std::string parse_digest_field(const std::string& header);

}  // namespace voxdag::server
