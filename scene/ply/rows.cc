#include "scene/ply/rows.h"

#include "core/base/error.h"
#include "scene/messages.h"
#include "scene/ply/numbers.h"
#include "scene/text/file_window.h"
#include "scene/text/numbers.h"
#include "scene/text/word_scanner.h"

namespace voxdag::ply {
namespace {

// Converts `count` integers at `bytes` to vertex indices.
using Decode = void (*)(const std::byte* bytes, size_t count, uint32_t* out);

template <class T, bool kBigEndian>
void decode_indices(const std::byte* bytes, size_t count, uint32_t* out) {
  if constexpr (std::is_integral_v<T>)
    for (size_t i = 0; i < count; ++i)
      out[i] = as_index(load<T>(bytes + i * sizeof(T), kBigEndian));
}

Decode decoder_of(Type type, bool is_big_endian) {
  return with_type(type, [&]<class T>(T) -> Decode {
    return is_big_endian ? &decode_indices<T, true> : &decode_indices<T, false>;
  });
}

class BinaryRows : public Rows {
 public:
  BinaryRows(const ReadableFile& file, bool is_big_endian, const Element& element, size_t list,
             MemoryBudget& budget)
      : Rows(file, element, budget), is_big_endian_(is_big_endian), window_(file, budget) {
    for (size_t i = 0; i < element.properties.size(); ++i) {
      const Property& property = element.properties[i];
      if (property.is_list) {
        lists_.push_back({bytes_before_, property.count_type, bytes_of(property.type), i == list,
                          decoder_of(property.type, is_big_endian)});
        bytes_before_ = 0;
      } else {
        bytes_before_ += bytes_of(property.type);
      }
    }
    is_plain_ = lists_.size() == 1 && lists_[0].is_wanted && lists_[0].bytes_before == 0 &&
                lists_[0].count_type == Type::kUint8;
  }

  uint64_t read(uint64_t row, uint64_t offset) override {
    if (is_plain_) {
      const uint64_t end = read_plain(offset);
      if (end > offset) return end;
    }
    entry_count_ = 0;
    for (const List& list : lists_) {
      offset += list.bytes_before;
      const size_t count_bytes = bytes_of(list.count_type);
      const auto bytes = window_.at(offset, count_bytes);
      if (bytes.size() < count_bytes) refuse_end(row);
      const uint64_t count =
          checked_count(count_at(bytes.data(), list.count_type), row, list.is_wanted);
      offset += count_bytes;
      if (list.is_wanted) read_entries(list, row, offset, static_cast<size_t>(count));
      offset += count * list.entry_bytes;
    }
    offset += bytes_before_;
    if (offset > file_.size()) refuse_end(row);
    return offset;
  }

 private:
  struct List {
    size_t bytes_before;  // bytes between the previous list and this one
    Type count_type;
    size_t entry_bytes;
    bool is_wanted;
    Decode decode;
  };

  // Reads a row of the usual form: a count of one byte, its entries, and the following properties.
  // Returns `offset` if the window does not contain the complete row.
  uint64_t read_plain(uint64_t offset) {
    const auto bytes = window_.at(offset, 1);
    if (bytes.empty()) return offset;
    const auto count = std::to_integer<size_t>(bytes[0]);
    const size_t row_bytes = 1 + count * lists_[0].entry_bytes + bytes_before_;
    if (bytes.size() < row_bytes) return offset;
    lists_[0].decode(bytes.data() + 1, count, entries_.data());
    entry_count_ = count;
    return offset + row_bytes;
  }

  int64_t count_at(const std::byte* bytes, Type type) const {
    return with_type(
        type, [&]<class T>(T) { return static_cast<int64_t>(load<T>(bytes, is_big_endian_)); });
  }

  void read_entries(const List& list, uint64_t row, uint64_t offset, size_t count) {
    const auto bytes = window_.at(offset, count * list.entry_bytes);
    if (bytes.size() < count * list.entry_bytes) refuse_end(row);
    list.decode(bytes.data(), count, entries_.data());
    entry_count_ = count;
  }

  [[noreturn]] void refuse_end(uint64_t row) const {
    refuse(row, "ends past the " + std::to_string(file_.size()) + " bytes of the file");
  }

  const bool is_big_endian_;
  FileWindow window_;
  std::vector<List> lists_;
  size_t bytes_before_ = 0;  // bytes of a row after its last list
  bool is_plain_ = false;    // true if read_plain() can read the rows
};

class AsciiRows : public Rows {
 public:
  AsciiRows(const ReadableFile& file, const Element& element, size_t list, MemoryBudget& budget)
      : Rows(file, element, budget), list_(list), text_(file, budget) {}

  uint64_t read(uint64_t row, uint64_t offset) override {
    entry_count_ = 0;
    text_.begin_row(offset);
    for (size_t i = 0; i < element_.properties.size(); ++i) {
      const uint64_t count =
          element_.properties[i].is_list ? checked_count(integer(row), row, i == list_) : 1;
      for (uint64_t k = 0; k < count; ++k)
        if (i == list_)
          entries_[entry_count_++] = index(row);
        else
          word(row);
    }
    if (!element_.properties.empty() && !text_.end_row())
      refuse(row, "has more on its line than its properties");
    return text_.offset();
  }

 private:
  std::string_view word(uint64_t row) {
    const std::string_view text = text_.word();
    if (text.empty()) refuse(row, "ends before its properties do");
    return text;
  }
  int64_t integer(uint64_t row) {
    const std::string_view text = word(row);
    if (const auto value = parse_integer(text)) return *value;
    refuse(row, "has " + printable(text) + ", expected an integer");
  }
  uint32_t index(uint64_t row) {
    const int64_t value = integer(row);
    return value < kNoVertex ? as_index(value) : kNoVertex;
  }

  const size_t list_;
  WordScanner text_;
};

}  // namespace

Rows::Rows(const ReadableFile& file, const Element& element, MemoryBudget& budget)
    : file_(file), element_(element), entries_(budget, kMaxEntries, "a row of " + file.path()) {}

uint64_t Rows::checked_count(int64_t count, uint64_t row, bool is_wanted) const {
  if (count < 0) refuse(row, "has a list of " + std::to_string(count) + " entries");
  const auto entries = static_cast<uint64_t>(count);
  if (is_wanted && entries > kMaxEntries)
    throw Error(ErrorCode::kLimit, file_.path() + ": " + element_.name + " " + std::to_string(row) +
                                       " has " + std::to_string(count) + " corners, the limit is " +
                                       std::to_string(kMaxEntries));
  if (entries > file_.size())
    refuse(row,
           "has a list of " + std::to_string(count) + " entries, more than the file has bytes");
  return entries;
}

void Rows::refuse(uint64_t row, const std::string& what) const {
  voxdag::refuse(file_.path(), printable(element_.name) + " " + std::to_string(row) + " " + what);
}

std::unique_ptr<Rows> open_rows(const ReadableFile& file, Format format, const Element& element,
                                size_t list, MemoryBudget& budget) {
  if (format == Format::kAscii) return std::make_unique<AsciiRows>(file, element, list, budget);
  return std::make_unique<BinaryRows>(file, format == Format::kBigEndian, element, list, budget);
}

}  // namespace voxdag::ply
