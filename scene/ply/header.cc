#include "scene/ply/header.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <span>
#include <string_view>

#include "core/base/error.h"
#include "core/base/page_buffer.h"
#include "scene/messages.h"

namespace voxdag::ply {
namespace {

constexpr uint64_t kMaxHeaderBytes = 64 << 10;

std::optional<Type> type_named(std::string_view name) {
  static constexpr std::pair<std::string_view, Type> kTypes[] = {
      {"char", Type::kInt8},      {"int8", Type::kInt8},     {"uchar", Type::kUint8},
      {"uint8", Type::kUint8},    {"short", Type::kInt16},   {"int16", Type::kInt16},
      {"ushort", Type::kUint16},  {"uint16", Type::kUint16}, {"int", Type::kInt32},
      {"int32", Type::kInt32},    {"uint", Type::kUint32},   {"uint32", Type::kUint32},
      {"float", Type::kFloat},    {"float32", Type::kFloat}, {"double", Type::kDouble},
      {"float64", Type::kDouble},
  };
  for (const auto& [known, type] : kTypes)
    if (name == known) return type;
  return std::nullopt;
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  constexpr std::string_view kBlanks = " \t";
  for (size_t begin = 0; (begin = line.find_first_not_of(kBlanks, begin)) != line.npos;) {
    const size_t end = std::min(line.find_first_of(kBlanks, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = end;
  }
  return words;
}

class HeaderParser {
 public:
  HeaderParser(const std::string& path, std::string_view text, bool is_whole_file)
      : path_(path), text_(text), is_whole_file_(is_whole_file) {}

  Header parse() {
    // The first line determines how lines end: with "\n", "\r\n" or "\r". The line end must be
    // known after end_header, because the data may begin with any byte.
    const size_t end = text_.find_first_of("\r\n");
    if (end == text_.npos) refuse("has no end of its first line");
    line_end_ = text_.substr(end).starts_with("\r\n") ? "\r\n" : text_.substr(end, 1);
    next_line();
    const auto format = words_of(next_line());
    if (format.size() < 3 || format[0] != "format") refuse("is not \"format NAME 1.0\"");
    header_.format = format_named(format[1]);
    if (format[2] != "1.0") refuse("names version " + printable(format[2]) + ", expected 1.0");
    for (;;) {
      const auto words = words_of(next_line());
      if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
      if (words[0] == "end_header") break;
      if (words[0] == "element")
        add_element(words);
      else if (words[0] == "property")
        add_property(words);
      else
        refuse("begins with " + printable(words[0]) +
               ", expected element, property, comment, obj_info or end_header");
    }
    header_.data_begin = at_;
    return std::move(header_);
  }

 private:
  std::string_view next_line() {
    const size_t end = text_.find(line_end_, at_);
    ++line_;
    if (end == text_.npos) {
      if (is_whole_file_) refuse("has no end, expected a header that ends with end_header");
      throw Error(ErrorCode::kLimit,
                  path_ + ": its header has over " + std::to_string(kMaxHeaderBytes) + " bytes");
    }
    const std::string_view line = text_.substr(at_, end - at_);
    at_ = end + line_end_.size();
    return line;
  }

  Format format_named(std::string_view name) const {
    if (name == "ascii") return Format::kAscii;
    if (name == "binary_little_endian") return Format::kLittleEndian;
    if (name == "binary_big_endian") return Format::kBigEndian;
    refuse("names the format " + printable(name) +
           ", expected ascii, binary_little_endian or binary_big_endian");
  }

  void add_element(const std::vector<std::string_view>& words) {
    Element element;
    if (words.size() != 3) refuse("is not \"element NAME COUNT\"");
    element.name = words[1];
    const char* const end = words[2].data() + words[2].size();
    const auto parsed = std::from_chars(words[2].data(), end, element.count);
    if (parsed.ec != std::errc() || parsed.ptr != end)
      refuse("has the count " + printable(words[2]) + ", expected a number below 2^64");
    for (const Element& other : header_.elements)
      if (other.name == element.name) refuse("repeats the name of an element");
    header_.elements.push_back(std::move(element));
  }

  void add_property(const std::vector<std::string_view>& words) {
    Property property;
    if (header_.elements.empty()) refuse("declares a property before any element");
    property.is_list = words.size() > 1 && words[1] == "list";
    if (words.size() != (property.is_list ? 5 : 3))
      refuse("is neither \"property TYPE NAME\" nor \"property list TYPE TYPE NAME\"");
    if (property.is_list) property.count_type = type_of(words[2]);
    property.type = type_of(words[words.size() - 2]);
    property.name = words.back();
    if (!is_integer(property.count_type))
      refuse("has a float type for the count of a list, expected an integer type");
    for (const Property& other : header_.elements.back().properties)
      if (other.name == property.name) refuse("repeats the name of a property");
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
  std::string_view line_end_;
  size_t at_ = 0;
  uint64_t line_ = 0;
  Header header_;
};

}  // namespace

Header read_header(const ReadableFile& file, MemoryBudget& budget) {
  const auto size = static_cast<size_t>(std::min(file.size(), kMaxHeaderBytes));
  PageBuffer<char> text(budget, size, "the header of " + file.path());
  file.read_at(0, std::as_writable_bytes(std::span(text.data(), size)));
  return HeaderParser(file.path(), {text.data(), size}, size == file.size()).parse();
}

}  // namespace voxdag::ply
