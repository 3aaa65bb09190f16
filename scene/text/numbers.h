// Parses the numbers that text files of scenes contain.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace voxdag {

// Returns the integer that the complete text denotes, or nullopt. Accepts a leading plus sign.
std::optional<int64_t> parse_integer(std::string_view text);

// Returns the float or double that the complete text denotes, rounded to nearest, or nullopt.
// Accepts a leading plus sign, "nan" and "inf" in upper or lower case, and "1.#IND", "1.#QNAN" and
// "1.#INF". Returns infinity for a number that is too large.
template <class T>
std::optional<double> parse_real(std::string_view text);
extern template std::optional<double> parse_real<float>(std::string_view text);
extern template std::optional<double> parse_real<double>(std::string_view text);

}  // namespace voxdag
