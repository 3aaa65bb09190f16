#include "scene/stl/stl_format.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "scene/stl/facet.h"
#include "scene/text/characters.h"

namespace voxdag::stl {
namespace {

constexpr size_t kMaxSniffedBytes = 64 << 10;
constexpr uint64_t kSniffedFacets = 8;

std::string first_bytes(const ReadableFile& file, uint64_t count) {
  std::string text(static_cast<size_t>(std::min(count, file.size())), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(text)));
  return text;
}

// Returns the next word in lower case, without the whitespace around it.
std::string next_keyword(std::string_view& text) {
  const auto is_space = [](char c) { return is_blank(c) || is_line_end(c); };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  std::string word;
  for (; !text.empty() && !is_space(text.front()); text.remove_prefix(1))
    word += lower(text.front());
  return word;
}

// True if the text has the words "facet normal" or "facet outer" before any zero byte.
bool has_facet(std::string_view text) {
  text = text.substr(0, text.find('\0'));
  std::string last;
  for (std::string word = next_keyword(text); !word.empty(); word = next_keyword(text)) {
    if (last == "facet" && (word == "normal" || word == "outer")) return true;
    last = std::move(word);
  }
  return false;
}

// True if the text begins with "solid", and one of these conditions holds: the next line that is
// not blank begins with "facet", "endsolid" or "color"; there is no such line; or a facet begins
// anywhere after the first line. The rest of the first line is the name of the solid.
bool is_ascii(std::string_view text) {
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  if (next_keyword(text) != "solid") return false;
  const size_t line_end = text.find_first_of("\r\n");
  if (line_end == text.npos) return text.find('\0') == text.npos;
  text.remove_prefix(line_end);
  std::string_view rest = text;
  const std::string second = next_keyword(rest);
  return second.empty() || second == "facet" || second == "endsolid" || second == "color" ||
         has_facet(text);
}

// True if the coordinates are 0 or have usual magnitudes, and the normal is roughly a unit vector
// or is 0.
bool is_plausible(const Facet& facet) {
  double square = 0;
  for (const double n : facet.normal) square += n * n;
  if (!(square < 1.5) || (square > 0 && square < 0.5)) return false;
  return std::ranges::all_of(facet.corners, [](double c) {
    return c == 0 || (std::abs(c) < 1e12 && std::abs(c) > 1e-12);
  });
}

bool has_plausible_facets(std::string_view text) {
  bool has_area = false;
  for (uint64_t at = kHeaderBytes; at + kFacetBytes <= text.size(); at += kFacetBytes) {
    const Facet facet = load_facet(std::as_bytes(std::span(text)).subspan(at));
    if (!is_plausible(facet)) return false;
    has_area = has_area || std::ranges::count(facet.corners, 0.0) < 8;
  }
  return has_area;
}

}  // namespace

uint64_t declared_facets(const ReadableFile& file) {
  std::array<std::byte, 4> bytes;
  file.read_at(kCountAt, bytes);
  return load_little_endian<uint32_t>(bytes.data());
}

Format format_of(const ReadableFile& file) {
  const bool has_header = file.size() >= kHeaderBytes;
  if (has_header && file.size() == kHeaderBytes + kFacetBytes * declared_facets(file))
    return Format::kBinary;
  if (is_ascii(first_bytes(file, kMaxSniffedBytes))) return Format::kAscii;
  const std::string facets = first_bytes(file, kHeaderBytes + kSniffedFacets * kFacetBytes);
  return has_plausible_facets(facets) ? Format::kBinary : Format::kNone;
}

}  // namespace voxdag::stl
