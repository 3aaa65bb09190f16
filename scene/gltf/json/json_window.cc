#include "scene/gltf/json/json_window.h"

#include <algorithm>
#include <array>
#include <string>

#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

constexpr size_t kWindowBytes = size_t{64} << 10;
// Number of characters of a string that always reach the parser: enough for every name and every
// path.
constexpr uint64_t kMaxShownCharacters = 4096;
// Memory per character of a string: the parser stores the string twice, raw and decoded, in buffers
// that grow by doubling, and passes a copy.
constexpr uint64_t kCopies = 6;
constexpr uint64_t kMaxWordCharacters = 1024;  // max length of a number or literal

// True for printable ASCII characters. Inside a string, only quotes and backslashes among them have
// a special meaning.
bool is_plain(char c) { return c >= ' ' && c <= '~'; }

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

// Spellings of NaN and infinity after an optional sign, in lower case. Longer spellings come first,
// because only the first spelling that matches is used.
constexpr std::string_view kNonFinite[] = {"nan(snan)", "nan(ind)", "nan",    "infinity", "inf",
                                           "1.#qnan",   "1.#snan",  "1.#ind", "1.#inf"};
constexpr std::string_view kEndsOfWords = ",]} \t\r\n";

}  // namespace

JsonWindow::JsonWindow(const ReadableFile& file, FileRange json, MemoryBudget& budget,
                       const CancelToken& cancel)
    : file_(file),
      json_(json),
      cancel_(cancel),
      charge_(budget, "a string in the JSON of " + file.path()),
      window_begin_(json.begin),
      position_(json.begin) {}

JsonWindow::int_type JsonWindow::uflow() {
  char c;
  if (!replacement_.empty()) {
    c = replacement_.front();
    replacement_.remove_prefix(1);
    return traits_type::to_int_type(c);
  }
  do {
    if (!next(c)) return traits_type::eof();
    track(c);
  } while (is_withheld(c));
  if (word_ == 1 && !in_string_) {
    if (const size_t length = non_finite_length()) {
      position_ += length - 1;
      c = 'n';
      replacement_ = "ull";
    }
  }
  charge_.grow_to(kCopies * ++collected_);
  return traits_type::to_int_type(c);
}

bool JsonWindow::next(char& c) {
  if (position_ >= window_begin_ + window_.size()) {
    const uint64_t left = json_.begin + json_.size - position_;
    if (left == 0) return false;
    cancel_.check();
    window_begin_ = position_;
    window_.resize(static_cast<size_t>(std::min<uint64_t>(left, kWindowBytes)));
    file_.read_at(window_begin_, std::as_writable_bytes(std::span(window_)));
  }
  c = window_[static_cast<size_t>(position_ - window_begin_)];
  ++position_;
  return true;
}

// Tracks where strings begin and end.
void JsonWindow::track(char c) {
  if (in_string_) return track_in_string(c);
  track_outside_strings(c);
  if (c != '"') return;
  in_string_ = true;
  after_backslash_ = in_escape_ = false;
  hex_digits_left_ = 0;
  collected_ = 0;
  string_ = {.characters = {position_, 0}};
}

void JsonWindow::track_outside_strings(char c) {
  switch (c) {
    case ' ':
    case '\t':
    case '\n':
    case '\r':
      is_second_blank_ = after_blank_;
      after_blank_ = true;
      word_ = 0;
      return;
    case '[':
    case ']':
    case '{':
    case '}':
    case ',':
    case ':':
    case '"':
      word_ = 0;
      break;
    default:
      ++word_;
      if (word_ == 1 && (c == '-' || (c >= '0' && c <= '9'))) collected_ = 0;
  }
  is_second_blank_ = after_blank_ = false;
  if (word_ > kMaxWordCharacters)
    refuse(file_.path(), "its JSON has a number of over " + std::to_string(kMaxWordCharacters) +
                             " characters at byte " + std::to_string(position_) +
                             ", expected fewer");
}

void JsonWindow::track_in_string(char c) {
  in_escape_ = true;
  if (after_backslash_) {
    after_backslash_ = false;
    hex_digits_left_ = c == 'u' ? 4 : 0;
  } else if (hex_digits_left_ > 0) {
    --hex_digits_left_;
  } else if (c == '\\') {
    after_backslash_ = string_.is_escaped = true;
  } else {
    in_escape_ = false;
    in_string_ = c != '"';
  }
  string_.characters.size += in_string_;
}

std::string_view JsonWindow::peek(std::span<char, kPeekCharacters> space) const {
  const uint64_t begin = position_ - 1;
  const size_t n =
      static_cast<size_t>(std::min<uint64_t>(kPeekCharacters, json_.begin + json_.size - begin));
  const auto at = static_cast<size_t>(begin - window_begin_);
  if (at + n <= window_.size()) return {window_.data() + at, n};
  file_.read_at(begin, std::as_writable_bytes(space.first(n)));
  return {space.data(), n};
}

size_t JsonWindow::non_finite_length() const {
  std::array<char, kPeekCharacters> space;
  const std::string_view text = peek(space);
  const size_t sign = text.front() == '-' || text.front() == '+' ? 1 : 0;
  const std::string_view word = text.substr(sign);
  // Nearly all words are neither NaN nor infinity, so this test comes first.
  const bool begins_with_letter =
      !word.empty() && std::string_view("NnIi").find(word.front()) != std::string_view::npos;
  if (!begins_with_letter && !word.starts_with("1.#")) return 0;
  for (const std::string_view spelling : kNonFinite) {
    if (!std::ranges::equal(word.substr(0, spelling.size()), spelling, {}, lower)) continue;
    size_t length = spelling.size();
    if (spelling.front() == '1')  // printf pads with zeros: "1.#INF00"
      length = std::min(word.find_first_not_of('0', length), word.size());
    const bool has_ended =
        length == word.size() || kEndsOfWords.find(word[length]) != kEndsOfWords.npos;
    return has_ended ? sign + length : 0;
  }
  return 0;
}

// True if the parser does not receive the character. Escapes and multi-byte characters always reach
// the parser, because it would refuse an incomplete one.
bool JsonWindow::is_withheld(char c) {
  if (!in_string_) return is_second_blank_;
  if (string_.characters.size <= kMaxShownCharacters || in_escape_ || !is_plain(c)) return false;
  string_.is_clipped = true;
  return true;
}

}  // namespace voxdag::gltf
