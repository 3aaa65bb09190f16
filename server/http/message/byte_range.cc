#include "server/http/message/byte_range.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "server/http/message/headers.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxRanges = 16;

// Parses a number of digits only. A number over 64 bits becomes the maximum, which is past the end
// of any file.
std::optional<uint64_t> parse_number(std::string_view text) {
  if (text.empty() || text.find_first_not_of("0123456789") != std::string_view::npos) return {};
  uint64_t value = 0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), value);
  return parsed.ec == std::errc::result_out_of_range ? UINT64_MAX : value;
}

enum class Parsed { kRange, kOutside, kMalformed };

// Parses "5-9", "5-" or "-4".
Parsed parse_range(std::string_view text, uint64_t size, ByteRange& range) {
  const size_t dash = text.find('-');
  if (dash == std::string_view::npos) return Parsed::kMalformed;
  const std::string_view first = text.substr(0, dash), last = text.substr(dash + 1);
  if (first.empty()) {
    const auto suffix = parse_number(last);
    if (!suffix) return Parsed::kMalformed;
    range = {size - std::min(size, *suffix), size};
    return *suffix == 0 ? Parsed::kOutside : Parsed::kRange;
  }
  const auto begin = parse_number(first);
  const auto end = last.empty() ? UINT64_MAX : parse_number(last);
  if (!begin || !end || *end < *begin) return Parsed::kMalformed;
  if (*begin >= size) return Parsed::kOutside;
  range = {*begin, std::min(size - 1, *end) + 1};
  return Parsed::kRange;
}

// True for one range, or if several ranges have at most `size` bytes in total. A larger total means
// that ranges overlap. Such ranges cost the server more than the client, and no download needs
// them.
bool is_reasonable(const std::vector<ByteRange>& ranges, uint64_t size) {
  uint64_t bytes = 0;
  for (const ByteRange& range : ranges) bytes += range.size();
  return ranges.size() == 1 || bytes <= size;
}

}  // namespace

RangeAnswer parse_ranges(std::string_view header, uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  header = trimmed(header);
  if (header.size() < kUnit.size() || !equal_ignoring_case(header.substr(0, kUnit.size()), kUnit))
    return {};
  header.remove_prefix(kUnit.size());
  RangeAnswer answer;
  size_t requested = 0;
  for (bool more = true; more;) {
    const size_t comma = header.find(',');
    more = comma != std::string_view::npos;
    const std::string_view text = trimmed(header.substr(0, comma));
    if (more) header.remove_prefix(comma + 1);
    if (text.empty()) continue;
    ByteRange range;
    const Parsed parsed = parse_range(text, size, range);
    if (parsed == Parsed::kMalformed || ++requested > kMaxRanges) return {};
    if (parsed == Parsed::kRange) answer.ranges.push_back(range);
  }
  if (requested == 0 || !is_reasonable(answer.ranges, size)) return {};
  answer.kind =
      answer.ranges.empty() ? RangeAnswer::Kind::kUnsatisfiable : RangeAnswer::Kind::kPart;
  return answer;
}

bool parse_content_range(std::string_view header, ByteRange& range, uint64_t& total) {
  constexpr std::string_view kUnit = "bytes ";
  header = trimmed(header);
  if (!header.starts_with(kUnit)) return false;
  header.remove_prefix(kUnit.size());
  const size_t dash = header.find('-'), slash = header.find('/');
  if (dash == std::string_view::npos || slash == std::string_view::npos || dash > slash)
    return false;
  const auto first = parse_number(header.substr(0, dash));
  const auto last = parse_number(header.substr(dash + 1, slash - dash - 1));
  const auto whole = parse_number(header.substr(slash + 1));
  if (!first || !last || !whole || *first > *last || *last >= *whole) return false;
  range = {*first, *last + 1};
  total = *whole;
  return true;
}

}  // namespace voxdag::server
