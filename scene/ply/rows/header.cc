#include "scene/ply/rows/header.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <span>
#include <utility>

#include "core/base/error.h"
#include "core/base/page_buffer.h"
#include "scene/messages.h"
#include "scene/text/characters.h"
#include "scene/text/numbers.h"

namespace voxdag::ply {
namespace {

constexpr uint64_t kMaxHeaderBytes = 64 << 10;
constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

std::optional<Type> type_named(std::string_view name) {
  static constexpr std::pair<std::string_view, Type> kTypes[] = {
      {"char", Type::kInt8},     {"int8", Type::kInt8},     {"uchar", Type::kUint8},
      {"uint8", Type::kUint8},   {"short", Type::kInt16},   {"int16", Type::kInt16},
      {"ushort", Type::kUint16}, {"uint16", Type::kUint16}, {"int", Type::kInt32},
      {"int32", Type::kInt32},   {"uint", Type::kUint32},   {"uint32", Type::kUint32},
      {"int64", Type::kInt64},   {"uint64", Type::kUint64}, {"float", Type::kFloat},
      {"float32", Type::kFloat}, {"double", Type::kDouble}, {"float64", Type::kDouble},
  };
  for (const auto& [known, type] : kTypes)
    if (equals_in_any_case(name, known)) return type;
  return std::nullopt;
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (;;) {
    const std::string_view word = next_word(line);
    if (word.empty()) return words;
    words.push_back(word);
  }
}

// True if an unknown word resembles a keyword that determines the layout of the file. It is then
// probably a misspelled keyword, without which the file would be misread.
bool resembles_keyword(std::string_view word) {
  constexpr std::string_view kBegins[] = {"elem", "prop", "form", "end_"};
  return std::ranges::any_of(kBegins, [&](std::string_view begin) {
    return equals_in_any_case(word.substr(0, 4), begin);
  });
}

// Returns the index of the item with this name. If there is none, ignores upper and lower case and
// returns the first match. Returns the number of items if no name matches.
template <class Item>
size_t find_named(const std::vector<Item>& items, std::string_view name) {
  auto found = std::ranges::find(items, name, &Item::name);
  if (found == items.end())
    found = std::ranges::find_if(
        items, [&](const Item& item) { return equals_in_any_case(item.name, name); });
  return static_cast<size_t>(found - items.begin());
}

class HeaderParser {
 public:
  HeaderParser(const std::string& path, std::string_view text, bool is_whole_file)
      : path_(path), text_(text), is_whole_file_(is_whole_file) {}

  Header parse() {
    at_ = first_line_bytes(text_);
    line_ = 1 + static_cast<uint64_t>(std::count(text_.data(), text_.data() + at_, '\n'));
    end_line();
    while (add_line(next_line())) {
    }
    if (!has_format_) refuse("ends a header without format, expected a line \"format NAME 1.0\"");
    header_.data_begin = at_;
    return std::move(header_);
  }

 private:
  std::string_view next_line() {
    ++line_;
    const size_t begin = at_;
    at_ = std::min(text_.find_first_of("\r\n", at_), text_.size());
    const std::string_view line = text_.substr(begin, at_ - begin);
    end_line();
    return line;
  }

  // Moves past a line end: LF, CR LF or CR. If all earlier lines end with CR alone, an LF after CR
  // may be the first byte of the data. So this LF does not count as a part of the line end.
  void end_line() {
    if (at_ == text_.size()) {
      if (is_whole_file_)
        refuse(
            "is where the file ends, expected more lines, up to the line end_header and its line "
            "end");
      throw Error(ErrorCode::kLimit, path_ + ": its header has over " +
                                         std::to_string(kMaxHeaderBytes) +
                                         " bytes, expected end_header within them");
    }
    const bool has_only_cr = has_cr_ && !has_lf_;
    const bool is_crlf = text_.substr(at_).starts_with("\r\n") && !has_only_cr;
    (is_crlf || text_[at_] == '\n' ? has_lf_ : has_cr_) = true;
    at_ += is_crlf ? 2 : 1;
  }

  // Interprets a line of the header. Returns false if the line ends the header.
  bool add_line(std::string_view line) {
    const auto words = words_of(line);
    const auto is = [&](std::string_view word) { return equals_in_any_case(words[0], word); };
    if (words.empty() || is("obj_info")) return true;
    if (is("end_header")) return false;
    if (is("comment"))
      add_comment(line);
    else if (is("format"))
      set_format(words);
    else if (is("element"))
      add_element(words);
    else if (is("property"))
      add_property(words);
    else
      ignore(words[0]);
    return true;
  }

  void ignore(std::string_view word) {
    if (resembles_keyword(word))
      refuse("begins with " + printable(word) +
             ", expected format, element, property, comment, obj_info or end_header");
    if (header_.ignored_lines++ > 0) return;
    header_.first_ignored_line = line_;
    header_.first_ignored_word = printable(word);
  }

  void add_comment(std::string_view line) {
    next_word(line);
    if (equals_in_any_case(next_word(line), "TextureFile"))
      header_.texture_files.emplace_back(trimmed(line));
  }

  void set_format(const std::vector<std::string_view>& words) {
    if (words.size() < 3) refuse("is incomplete, expected \"format NAME 1.0\"");
    if (has_format_) refuse("is a second format line, expected one");
    header_.format = format_named(words[1]);
    if (parse_real<double>(words[2]) != 1.0)
      refuse("names version " + printable(words[2]) + ", expected 1.0");
    has_format_ = true;
  }

  Format format_named(std::string_view name) const {
    if (equals_in_any_case(name, "ascii")) return Format::kAscii;
    if (equals_in_any_case(name, "binary_little_endian")) return Format::kLittleEndian;
    if (equals_in_any_case(name, "binary_big_endian")) return Format::kBigEndian;
    refuse("names the format " + printable(name) +
           ", expected ascii, binary_little_endian or binary_big_endian");
  }

  void add_element(const std::vector<std::string_view>& words) {
    Element element;
    if (words.size() != 3)
      refuse("has " + std::to_string(words.size()) + " words, expected \"element NAME COUNT\"");
    element.name = words[1];
    const char* const end = words[2].data() + words[2].size();
    const auto parsed = std::from_chars(words[2].data(), end, element.count);
    if (parsed.ec != std::errc() || parsed.ptr != end)
      refuse("has the count " + printable(words[2]) +
             ", expected a whole number below 2^64, in digits");
    for (const Element& other : header_.elements)
      if (other.name == element.name)
        refuse("repeats the name of an element, " + printable(other.name) +
               ", expected a new name");
    header_.elements.push_back(std::move(element));
  }

  void add_property(const std::vector<std::string_view>& words) {
    Property property;
    if (header_.elements.empty())
      refuse("declares a property before any element, expected an element line first");
    property.is_list = words.size() > 1 && equals_in_any_case(words[1], "list");
    if (words.size() != (property.is_list ? 5 : 3))
      refuse("has " + std::to_string(words.size()) +
             " words, expected \"property TYPE NAME\" or \"property list TYPE TYPE NAME\"");
    if (property.is_list) property.count_type = type_of(words[2]);
    property.type = type_of(words[words.size() - 2]);
    property.name = words.back();
    if (!is_integer(property.count_type))
      refuse("has a float type for the count of a list, expected an integer type");
    for (const Property& other : header_.elements.back().properties)
      if (other.name == property.name)
        refuse("repeats the name of a property, " + printable(other.name) +
               ", expected a new name");
    header_.elements.back().properties.push_back(std::move(property));
  }

  Type type_of(std::string_view name) const {
    if (const auto type = type_named(name)) return *type;
    refuse("names the type " + printable(name) +
           ", expected char, uchar, short, ushort, int, uint, float or double");
  }

  [[noreturn]] void refuse(const std::string& what) const {
    voxdag::refuse(path_, "line " + std::to_string(line_) + " of the header " + what);
  }

  const std::string& path_;
  const std::string_view text_;
  const bool is_whole_file_;
  bool has_cr_ = false, has_lf_ = false;  // true if a line ended with CR alone, with LF
  bool has_format_ = false;
  size_t at_ = 0;
  uint64_t line_ = 0;
  Header header_;
};

}  // namespace

size_t Element::find(std::string_view property) const { return find_named(properties, property); }
size_t Header::find(std::string_view element) const { return find_named(elements, element); }

size_t first_line_bytes(std::string_view text) {
  size_t at = text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
  while (at < text.size() && (is_blank(text[at]) || is_line_end(text[at]))) ++at;
  if (!equals_in_any_case(text.substr(at, 3), "ply")) return 0;
  at += 3;
  while (at < text.size() && is_blank(text[at])) ++at;
  return at < text.size() && is_line_end(text[at]) ? at : 0;
}

Header read_header(const ReadableFile& file, MemoryBudget& budget) {
  const auto size = static_cast<size_t>(std::min(file.size(), kMaxHeaderBytes));
  PageBuffer<char> text(budget, size, "the header of " + file.path());
  file.read_at(0, std::as_writable_bytes(std::span(text.data(), size)));
  return HeaderParser(file.path(), {text.data(), size}, size == file.size()).parse();
}

}  // namespace voxdag::ply
