// Numbers as PLY files store them: bytes in either order, or text.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>

#include "scene/load_number.h"
#include "scene/ply/rows/header.h"

namespace voxdag::ply {

// Stands for an index that is negative or needs more than 32 bits. No vertex has this index.
constexpr uint32_t kNoVertex = std::numeric_limits<uint32_t>::max();

// Calls body(T{}) with the C++ type for `type`.
template <class Body>
decltype(auto) with_type(Type type, const Body& body) {
  switch (type) {
    case Type::kInt8:
      return body(int8_t{});
    case Type::kUint8:
      return body(uint8_t{});
    case Type::kInt16:
      return body(int16_t{});
    case Type::kUint16:
      return body(uint16_t{});
    case Type::kInt32:
      return body(int32_t{});
    case Type::kUint32:
      return body(uint32_t{});
    case Type::kInt64:
      return body(int64_t{});
    case Type::kUint64:
      return body(uint64_t{});
    case Type::kFloat:
      return body(float{});
    default:
      return body(double{});
  }
}

template <std::integral T>
uint32_t as_index(T value) {
  return std::in_range<uint32_t>(value) ? static_cast<uint32_t>(value) : kNoVertex;
}

// Returns the integer that the complete text denotes, or nullopt. Accepts a real number that is an
// integer, such as "3.0".
std::optional<int64_t> parse_whole_number(std::string_view text);

// Parses the complete text as a number of type `type`, with parse_whole_number() or parse_real().
// Returns nullopt if the text is not such a number.
std::optional<double> parse_number(std::string_view text, Type type);

}  // namespace voxdag::ply
