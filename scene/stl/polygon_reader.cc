#include "scene/stl/polygon_reader.h"

#include <algorithm>

#include "core/base/error.h"
#include "scene/messages.h"
#include "scene/text/characters.h"
#include "scene/text/numbers.h"

namespace voxdag::stl {
namespace {

bool is_keyword(std::string_view word) {
  constexpr std::string_view kKeywords[] = {"vertex",  "facet", "endfacet", "outer", "loop",
                                            "endloop", "solid", "endsolid", "normal"};
  return std::ranges::any_of(
      kKeywords, [&](std::string_view keyword) { return equals_in_any_case(keyword, word); });
}

// True if `word`, followed by the text `after`, begins a facet. The word "facet" alone does not
// suffice, because the name of a solid may contain it.
bool begins_facet(std::string_view word, std::string_view after) {
  if (!equals_in_any_case(word, "facet")) return false;
  const std::string_view next = next_word(after);
  return equals_in_any_case(next, "normal") || equals_in_any_case(next, "outer");
}

// True if `word`, followed by the text `after`, is part of STL: it begins a facet or a vertex, or
// ends a loop, a facet or a solid.
bool begins_statement(std::string_view word, std::string_view after) {
  if (equals_in_any_case(word, "vertex")) return parse_real<double>(next_word(after)).has_value();
  constexpr std::string_view kEnds[] = {"endloop", "endfacet", "endsolid"};
  return begins_facet(word, after) || std::ranges::any_of(kEnds, [&](std::string_view end) {
           return equals_in_any_case(end, word);
         });
}

}  // namespace

void PolygonReader::seek(uint64_t offset, uint64_t line) {
  lines_.seek(offset, line);
  rest_ = {};
  is_name_next_ = false;
}

bool PolygonReader::next() {
  if (!read_vertices()) return false;
  split_ = {};
  if (vertices_.size() > 3) triangulate();
  return true;
}

void PolygonReader::triangulate() {
  xyz_.clear();
  for (const auto& vertex : vertices_) xyz_.insert(xyz_.end(), vertex.begin(), vertex.end());
  if (triangulator_.triangulate(xyz_)) split_ = triangulator_.triangles();
}

const std::array<double, 3>& PolygonReader::vertex(size_t triangle, size_t k) const {
  return vertices_[polygon::position_of_corner(split_, triangle, k)];
}

// Reads the vertices of the next polygon. Returns false if the file has no other polygon.
bool PolygonReader::read_vertices() {
  vertices_.clear();
  for (;;) {
    const std::string_view word = next_word(rest_);
    if (word.empty()) {
      if (next_line()) continue;
      is_cut_off_ = in_facet_;
      line_ = lines_.number();
      return !vertices_.empty();
    }
    if (equals_in_any_case(word, "vertex")) {
      if (vertices_.empty()) {
        offset_ = lines_.offset_of(word);
        line_ = lines_.number();
      }
      read_vertex();
    } else {
      skip(word);
      if (!vertices_.empty()) return true;
    }
  }
}

bool PolygonReader::next_line() {
  const bool found = lines_.next();
  rest_ = found ? lines_.text() : std::string_view();
  return found;
}

// Processes a word other than "vertex": skips the name or the numbers that follow it, or the
// unknown words that it begins.
void PolygonReader::skip(std::string_view word) {
  const auto is = [&](std::string_view keyword) { return equals_in_any_case(word, keyword); };
  if (!is_keyword(word)) return skip_unknown();
  is_name_next_ = false;
  if (is("facet")) {
    in_facet_ = true;
  } else if (is("endfacet")) {
    in_facet_ = false;
  } else if (is("normal")) {
    skip_normal();
  } else if (is("solid") || is("endsolid")) {
    is_name_next_ = trimmed(rest_).empty();
    skip_words(begins_facet);
  }
}

// Skips words that are not part of STL, and counts them for a warning. Does not count a single word
// in the line after "solid", because it is the name of the solid.
void PolygonReader::skip_unknown() {
  if (is_name_next_ && trimmed(rest_).empty()) return;
  if (unknown_words_++ == 0) first_unknown_line_ = lines_.number();
  skip_words(begins_statement);
}

// Skips the rest of the line, but stops before the first word for which `is_end` is true.
void PolygonReader::skip_words(bool (*is_end)(std::string_view word, std::string_view after)) {
  for (std::string_view after = rest_;; rest_ = after) {
    const std::string_view word = next_word(after);
    if (word.empty() || is_end(word, after)) return;
  }
}

// Skips the words of the normal: up to three, which are usually numbers. Stops at a keyword.
void PolygonReader::skip_normal() {
  for (int i = 0; i < 3; ++i) {
    std::string_view after = rest_, word = next_word(after);
    while (word.empty()) {
      if (!next_line()) return;
      after = rest_;
      word = next_word(after);
    }
    if (is_keyword(word)) return;
    rest_ = after;
  }
}

void PolygonReader::read_vertex() {
  std::array<double, 3> numbers;
  for (double& number : numbers) {
    std::string_view word;
    while ((word = next_word(rest_)).empty())
      if (!next_line()) refuse_line("has a vertex without three numbers, expected x, y and z");
    const auto value = parse_real<double>(word);
    if (!value) refuse_line("has " + printable(word) + ", expected a coordinate of a vertex");
    number = *value;
  }
  if (vertices_.size() == kMaxCorners)
    throw Error(ErrorCode::kLimit, file_.path() + ": line " + std::to_string(line_) +
                                       " begins a facet of more vertices than the limit, " +
                                       std::to_string(kMaxCorners));
  vertices_.push_back(numbers);
}

void PolygonReader::refuse_line(const std::string& what) const {
  refuse(file_.path(), "line " + std::to_string(lines_.number()) + " " + what);
}

}  // namespace voxdag::stl
