#include "scene/ply/rows/strip_reader.h"

#include <limits>
#include <type_traits>

#include "scene/messages.h"
#include "scene/ply/rows/numbers.h"

namespace voxdag::ply {
namespace {

int64_t restart_of(Type type, uint64_t vertices) {
  return with_type(type, [&]<class T>(T) -> int64_t {
    if constexpr (std::is_unsigned_v<T> && sizeof(T) < sizeof(uint64_t))
      return std::numeric_limits<T>::max() < vertices ? -1 : std::numeric_limits<T>::max();
    return -1;
  });
}

}  // namespace

StripReader::StripReader(const ReadableFile& file, Format format, const Element& element,
                         size_t list, uint64_t vertices, MemoryBudget& budget)
    : file_(file),
      format_(format),
      element_(element),
      list_(list),
      restart_(restart_of(element.properties[list].type, vertices)) {
  if (format == Format::kAscii)
    text_.emplace(file, budget);
  else
    window_.emplace(file, budget);
}

bool StripReader::next(uint32_t* corners) {
  while (next_entry()) {
    if (at_.strip_entries < 2) {
      at_.last[at_.strip_entries++] = entry_;
      continue;
    }
    const bool is_odd = at_.is_odd;
    const uint32_t a = at_.last[0], b = at_.last[1], c = entry_;
    at_.last[0] = b;
    at_.last[1] = c;
    at_.is_odd = !is_odd;
    if (a == b || b == c || a == c) continue;
    corners[0] = is_odd ? b : a;
    corners[1] = is_odd ? a : b;
    corners[2] = c;
    return true;
  }
  return false;
}

// Sets entry_ to the next entry of the lists of vertex indices. Returns false at the end of the
// element.
bool StripReader::next_entry() {
  for (;;) {
    while (at_.left == 0) {
      if (at_.row > 0) skip_properties(list_ + 1, element_.properties.size());
      if (at_.row == element_.count) return false;
      begin_row();
    }
    --at_.left;
    const int64_t value = integer(element_.properties[list_].type);
    entry_ = as_index(value);
    if (value != -1 && value != restart_) return true;
    at_.strip_entries = 0;
    at_.is_odd = false;
  }
}

void StripReader::begin_row() {
  ++at_.row;
  at_.strip_entries = 0;
  at_.is_odd = false;
  skip_properties(0, list_);
  at_.left = static_cast<uint64_t>(list_count(element_.properties[list_]));
}

void StripReader::skip_properties(size_t begin, size_t end) {
  for (size_t i = begin; i < end; ++i) {
    const Property& property = element_.properties[i];
    skip(property.type,
         property.is_list ? static_cast<uint64_t>(list_count(property)) : uint64_t{1});
  }
}

// Reads the number of entries of a list. Refuses a negative number, and one above the file's size
// in bytes.
int64_t StripReader::list_count(const Property& property) {
  const int64_t count = integer(property.count_type);
  if (count < 0 || static_cast<uint64_t>(count) > file_.size())
    refuse("has a list of " + std::to_string(count) + " entries, expected 0 to " +
           std::to_string(file_.size()) + ", because the file has that many bytes");
  return count;
}

int64_t StripReader::integer(Type type) {
  if (!text_)
    return with_type(type, [&]<class T>(T) {
      const bool is_big_endian = format_ == Format::kBigEndian;
      return static_cast<int64_t>(load_number<T>(bytes(sizeof(T)), is_big_endian));
    });
  const std::string_view text = word();
  if (const auto value = parse_whole_number(text)) return *value;
  refuse("has " + printable(text) + ", expected an integer");
}

void StripReader::skip(Type type, uint64_t count) {
  if (text_) {
    while (count-- > 0) word();
    return;
  }
  at_.offset += count * bytes_of(type);
  if (at_.offset > file_.size())
    refuse("is cut off: the file ends after " + std::to_string(file_.size()) + " bytes");
}

const std::byte* StripReader::bytes(size_t size) {
  const auto read = window_->at(at_.offset, size);
  if (read.size() < size)
    refuse("is cut off: the file ends after " + std::to_string(file_.size()) + " bytes");
  at_.offset += size;
  return read.data();
}

std::string_view StripReader::word() {
  text_->begin_row(at_.offset);
  const std::string_view text = text_->word();
  if (text.empty()) refuse("has too few values, expected one for each property");
  at_.offset = text_->offset();
  return text;
}

void StripReader::refuse(const std::string& what) const {
  voxdag::refuse(file_.path(),
                 printable(element_.name) + " " + std::to_string(at_.row - 1) + " " + what);
}

}  // namespace voxdag::ply
