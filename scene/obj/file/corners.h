// The corners of an OBJ face: v, v/vt, v//vn or v/vt/vn, with indices that count from 1 or, if they
// are negative, back from the last statement before the face.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <string_view>

#include "scene/obj/file/numbers.h"

namespace voxdag::obj {

// Stands for an index that is out of range. No vertex and no texture coordinate has this index.
constexpr uint32_t kNoIndex = std::numeric_limits<uint32_t>::max();

struct Corner {
  int64_t vertex = 0;
  int64_t texture = 0;  // 0: none
};

// Removes an integer from the beginning of the text. A magnitude above 2^53 is replaced by 2^53.
// Returns false if the text does not begin with an integer.
inline bool next_integer(std::string_view& text, int64_t& out) {
  constexpr int64_t kMax = int64_t{1} << 53;
  const bool is_negative = !text.empty() && text.front() == '-';
  if (!text.empty() && (is_negative || text.front() == '+')) text.remove_prefix(1);
  size_t digits = 0;
  int64_t value = 0;
  for (; digits < text.size() && text[digits] >= '0' && text[digits] <= '9'; ++digits)
    if (value < kMax) value = 10 * value + (text[digits] - '0');
  text.remove_prefix(digits);
  out = is_negative ? -value : value;
  return digits > 0;
}

// Removes a corner from the beginning of the arguments, which must begin with a word. Returns false
// if the word is not a corner.
inline bool next_corner(std::string_view& arguments, Corner& out) {
  const auto has_slash = [&] {
    const bool found = !arguments.empty() && arguments.front() == '/';
    if (found) arguments.remove_prefix(1);
    return found;
  };
  out.texture = 0;
  if (!next_integer(arguments, out.vertex)) return false;
  if (has_slash()) {
    next_integer(arguments, out.texture);
    int64_t normal;
    if (has_slash()) next_integer(arguments, normal);
  }
  return arguments.empty() || is_blank(arguments.front());
}

// Facts about the corners of a face, which the first pass over the file collects.
struct FaceCorners {
  size_t count = 0;  // number of corners
  // True if a corner has no texture coordinates, or an index before the first vt statement.
  bool lacks_texture = false;
  int64_t max_texture = 0;  // the largest index of texture coordinates, which counts from 1
};

// Counts the corners of an f statement with these arguments, and collects facts about them.
// `texcoords` is the number of vt statements before the face. A word that is not a corner is
// counted as a corner without texture coordinates.
inline FaceCorners scan_corners(std::string_view arguments, uint64_t texcoords) {
  FaceCorners out;
  for (; has_word(arguments); ++out.count) {
    Corner corner;
    const bool is_corner = next_corner(arguments, corner);
    while (!arguments.empty() && !is_blank(arguments.front())) arguments.remove_prefix(1);
    const bool is_before_first = corner.texture + static_cast<int64_t>(texcoords) < 0;
    out.lacks_texture |= !is_corner || corner.texture == 0 || is_before_first;
    out.max_texture = std::max(out.max_texture, corner.texture);
  }
  return out;
}

// Converts an index of the file, which counts from 1 or from the end, to an index that counts from
// 0. `before` is the number of v or vt statements before the face.
inline uint32_t resolve(int64_t index, uint64_t before) {
  const int64_t from_0 = index > 0 ? index - 1 : static_cast<int64_t>(before) + index;
  return index != 0 && from_0 >= 0 && from_0 < kNoIndex ? static_cast<uint32_t>(from_0) : kNoIndex;
}

}  // namespace voxdag::obj
