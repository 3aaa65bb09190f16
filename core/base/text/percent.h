// Percent-encodes texts for URLs. core/base/text.h has percent_decoded(). Pure functions.
#pragma once

#include <string>
#include <string_view>

namespace voxdag {

// Encodes every byte except the unreserved characters of RFC 3986 (letters, digits, "-._~"), so
// that the text can be a path segment or the value of a query parameter.
std::string percent_encoded(std::string_view text);

}  // namespace voxdag
