// The attributes that cells of the color grid can have, and which of them a build stores.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"

namespace voxdag {

// The numbers are those of the kinds of sections in the global file.
enum class Attribute : uint32_t { kColor = 1, kAlpha = 2, kNormal = 3, kMaterial = 4 };

inline constexpr Attribute kAllAttributes[] = {Attribute::kColor, Attribute::kAlpha,
                                               Attribute::kNormal, Attribute::kMaterial};

constexpr const char* name_of(Attribute attribute) {
  constexpr const char* kNames[] = {"color", "alpha", "normal", "material"};
  return kNames[static_cast<size_t>(attribute) - 1];
}

struct AttributeSet {
  bool color = false, alpha = false, normal = false, material = false;

  constexpr bool has(Attribute attribute) const {
    return attribute == Attribute::kColor    ? color
           : attribute == Attribute::kAlpha  ? alpha
           : attribute == Attribute::kNormal ? normal
                                             : material;
  }
  void add(Attribute attribute) {
    color |= attribute == Attribute::kColor;
    alpha |= attribute == Attribute::kAlpha;
    normal |= attribute == Attribute::kNormal;
    material |= attribute == Attribute::kMaterial;
  }
  constexpr bool any() const { return color || alpha || normal || material; }
  // Whether some of them depend on textures.
  constexpr bool shows_images() const { return color || alpha; }
  bool operator==(const AttributeSet&) const = default;

  // In the order of their numbers.
  std::vector<Attribute> list() const {
    std::vector<Attribute> all;
    for (const Attribute attribute : kAllAttributes)
      if (has(attribute)) all.push_back(attribute);
    return all;
  }
  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const Attribute attribute : list()) all.emplace_back(name_of(attribute));
    return all;
  }
};

// Adds an attribute by its name. Throws Error{kInvalidInput} that names `option`.
inline void add_attribute(AttributeSet& set, std::string_view name, const std::string& option) {
  for (const Attribute attribute : kAllAttributes)
    if (name == name_of(attribute)) return set.add(attribute);
  throw Error(ErrorCode::kInvalidInput, option + ": '" + std::string(name) +
                                            "' is no attribute: expected color, alpha, normal or "
                                            "material");
}

// Those of a comma list.
inline AttributeSet parse_attributes(std::string_view text, const std::string& option) {
  AttributeSet set;
  for (size_t at = 0; at <= text.size();) {
    const size_t end = std::min(text.find(',', at), text.size());
    add_attribute(set, text.substr(at, end - at), option);
    at = end + 1;
  }
  return set;
}

}  // namespace voxdag
