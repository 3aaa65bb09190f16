// SHA-256 in the header fields Content-Digest and Repr-Digest (RFC 9530).
#pragma once

#include <string>

#include "core/format/checksum.h"

namespace voxdag::server {

using voxdag::digest_field;
// Returns the SHA-256 of a Content-Digest or Repr-Digest header in hex. Throws
// RequestError{kInvalid} for a malformed header, and for a header with only other algorithms: the
// client requested a check, so the service must not skip it.
std::string parse_digest_field(const std::string& header);

}  // namespace voxdag::server
