// SHA-256 as the header fields Content-Digest and Repr-Digest carry it (RFC 9530).
#pragma once

#include <string>

#include "core/format/checksum.h"

namespace voxdag::server {

using voxdag::digest_field;
// The SHA-256 of a Content-Digest or Repr-Digest header in hex. Throws RequestError{kInvalid} for a
// header that is broken or has other algorithms only: a check that a client asks for is not
// skipped.
std::string parse_digest_field(const std::string& header);

}  // namespace voxdag::server
