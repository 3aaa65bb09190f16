// A set of attributes, such as the attributes that a build stores.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/color/attributes.h"

namespace voxdag {

class AttributeSet {
 public:
  constexpr AttributeSet() = default;
  constexpr AttributeSet(std::initializer_list<Attribute> attributes) {
    for (const Attribute attribute : attributes) add(attribute);
  }
  static constexpr AttributeSet all() {
    AttributeSet set;
    for (const AttributeTraits& row : kAttributeTable) set.add(row.attribute);
    return set;
  }

  constexpr bool operator[](Attribute attribute) const { return has_[index_of(attribute)]; }
  constexpr bool& operator[](Attribute attribute) { return has_[index_of(attribute)]; }
  constexpr bool has(Attribute attribute) const { return (*this)[attribute]; }
  constexpr void add(Attribute attribute) { (*this)[attribute] = true; }
  constexpr AttributeSet without(Attribute attribute) const {
    AttributeSet rest = *this;
    rest[attribute] = false;
    return rest;
  }
  constexpr bool any() const { return *this != AttributeSet(); }
  // True if any attribute of the set depends on the scene's textures.
  constexpr bool use_images() const { return any_row(&AttributeTraits::uses_images); }
  // True if the values of any attribute of the set are indexes of a list of names.
  constexpr bool have_names() const { return any_row(&AttributeTraits::has_names); }
  constexpr bool operator==(const AttributeSet&) const = default;

  // Returns the attributes in the order of their sections in the global file.
  std::vector<Attribute> list() const {
    std::vector<Attribute> found;
    for (const AttributeTraits& row : kAttributeTable)
      if (has(row.attribute)) found.push_back(row.attribute);
    return found;
  }
  std::vector<std::string> names() const {
    std::vector<std::string> found;
    for (const Attribute attribute : list()) found.emplace_back(name_of(attribute));
    return found;
  }

 private:
  static constexpr size_t index_of(Attribute attribute) {
    return static_cast<size_t>(attribute) - 1;
  }
  constexpr bool any_row(auto AttributeTraits::*property) const {
    return std::ranges::any_of(kAttributeTable, [&](const AttributeTraits& row) {
      return has(row.attribute) && std::invoke(property, row);
    });
  }

  bool has_[std::size(kAttributeTable)] = {};
};

// Returns the attribute named `name`. Throws Error{kInvalidInput} if no attribute has this name.
// The message begins with `option`, the option to which the user gave the name.
inline Attribute attribute_named(std::string_view name, const std::string& option) {
  std::string expected = kAttributeTable[0].name;
  for (const AttributeTraits& row : kAttributeTable) {
    if (name == row.name) return row.attribute;
    if (&row == kAttributeTable) continue;
    expected += (&row == std::end(kAttributeTable) - 1 ? " or " : ", ") + std::string(row.name);
  }
  throw Error(ErrorCode::kInvalidInput,
              option + ": '" + std::string(name) + "' is not an attribute: expected " + expected);
}

}  // namespace voxdag
