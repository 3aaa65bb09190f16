#include "scene/ply/numbers.h"

#include "scene/text/numbers.h"

namespace voxdag::ply {

std::optional<double> parse_number(std::string_view text, Type type) {
  if (type == Type::kDouble) return parse_real<double>(text);
  if (type == Type::kFloat) return parse_real<float>(text);
  const auto integer = parse_integer(text);
  return integer ? std::optional(static_cast<double>(*integer)) : std::nullopt;
}

}  // namespace voxdag::ply
