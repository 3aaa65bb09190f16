// SHA-256 as the header fields Content-Digest and Repr-Digest carry it (RFC 9530).
#pragma once

#include <string>

namespace voxdag::server {

// "sha-256=:BASE64:" of a digest in hex.
std::string digest_field(const std::string& sha256);
// The SHA-256 of a Content-Digest or Repr-Digest header in hex. Throws RequestError{kInvalid} for a
// header that is broken or has other algorithms only: a check that a client asks for is not
// skipped.
std::string parse_digest_field(const std::string& header);

}  // namespace voxdag::server
