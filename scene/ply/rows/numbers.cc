#include "scene/ply/rows/numbers.h"

#include <cmath>

#include "scene/text/numbers.h"

namespace voxdag::ply {

std::optional<int64_t> parse_whole_number(std::string_view text) {
  if (const auto integer = parse_integer(text)) return integer;
  constexpr double kMax = int64_t{1} << 53;
  const auto real = parse_real<double>(text);
  if (!real || !(std::fabs(*real) <= kMax) || std::floor(*real) != *real) return std::nullopt;
  return static_cast<int64_t>(*real);
}

std::optional<double> parse_number(std::string_view text, Type type) {
  if (type == Type::kDouble) return parse_real<double>(text);
  if (type == Type::kFloat) return parse_real<float>(text);
  const auto integer = parse_whole_number(text);
  return integer ? std::optional(static_cast<double>(*integer)) : std::nullopt;
}

}  // namespace voxdag::ply
