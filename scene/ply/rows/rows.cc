#include "scene/ply/rows/rows.h"

#include <algorithm>

#include "core/base/error.h"
#include "scene/messages.h"
#include "scene/ply/rows/numbers.h"
#include "scene/text/file_window.h"

namespace voxdag::ply {
namespace {

constexpr size_t kNoProperty = RequestedProperties::kNone;

// Functions that convert the `count` numbers at `bytes` to vertex indices or doubles.
using DecodeIndices = void (*)(const std::byte* bytes, size_t count, uint32_t* out);
using DecodeReals = void (*)(const std::byte* bytes, size_t count, double* out);

template <class T, bool kBigEndian>
void decode_indices(const std::byte* bytes, size_t count, uint32_t* out) {
  if constexpr (std::is_integral_v<T>)
    for (size_t i = 0; i < count; ++i)
      out[i] = as_index(load_number<T>(bytes + i * sizeof(T), kBigEndian));
}

template <class T, bool kBigEndian>
void decode_reals(const std::byte* bytes, size_t count, double* out) {
  for (size_t i = 0; i < count; ++i)
    out[i] = static_cast<double>(load_number<T>(bytes + i * sizeof(T), kBigEndian));
}

DecodeIndices indices_decoder(Type type, bool is_big_endian) {
  return with_type(type, [&]<class T>(T) -> DecodeIndices {
    return is_big_endian ? &decode_indices<T, true> : &decode_indices<T, false>;
  });
}

DecodeReals reals_decoder(Type type, bool is_big_endian) {
  return with_type(type, [&]<class T>(T) -> DecodeReals {
    return is_big_endian ? &decode_reals<T, true> : &decode_reals<T, false>;
  });
}

class BinaryRows : public Rows {
 public:
  BinaryRows(const ReadableFile& file, bool is_big_endian, const Element& element,
             const RequestedProperties& requested, MemoryBudget& budget)
      : Rows(file, element, requested, budget),
        is_big_endian_(is_big_endian),
        window_(file, budget) {
    for (size_t i = 0; i < element.properties.size(); ++i) add_step(i, element.properties[i]);
    is_plain_ = steps_.size() == 1 && steps_[0].property == requested.indices &&
                steps_[0].bytes_before == 0 && steps_[0].count_type == Type::kUint8;
  }

  uint64_t read(uint64_t row, uint64_t offset) override {
    if (is_plain_) {
      const uint64_t end = read_plain(offset);
      if (end > offset) return end;
    }
    index_count_ = real_count_ = 0;
    for (const Step& step : steps_) {
      offset += step.bytes_before;
      offset = step.number == kNoProperty ? read_list(step, row, offset)
                                          : read_number(step, row, offset);
    }
    offset += bytes_before_;
    if (offset > file_.size()) refuse_end(row);
    return offset;
  }

 private:
  // One step of reading a row: a list, or a requested number.
  struct Step {
    size_t bytes_before;  // bytes between the previous step and this one
    size_t property;
    size_t number;  // position in numbers(); kNoProperty for a list
    Type count_type;
    size_t value_bytes;
    DecodeIndices decode_indices;
    DecodeReals decode_reals;
  };

  void add_step(size_t index, const Property& property) {
    const size_t number = property.is_list ? kNoProperty : number_of(index);
    if (!property.is_list && number == kNoProperty) {
      bytes_before_ += bytes_of(property.type);
      return;
    }
    steps_.push_back({bytes_before_, index, number, property.count_type, bytes_of(property.type),
                      indices_decoder(property.type, is_big_endian_),
                      reals_decoder(property.type, is_big_endian_)});
    bytes_before_ = 0;
  }

  // Reads a row of the usual form: a count of one byte, its entries, and the following properties.
  // Returns `offset` if the window does not contain the complete row.
  uint64_t read_plain(uint64_t offset) {
    const auto bytes = window_.at(offset, 1);
    if (bytes.empty()) return offset;
    const auto count = std::to_integer<size_t>(bytes[0]);
    const size_t row_bytes = 1 + count * steps_[0].value_bytes + bytes_before_;
    if (bytes.size() < row_bytes) return offset;
    steps_[0].decode_indices(bytes.data() + 1, count, indices_.data());
    index_count_ = count;
    return offset + row_bytes;
  }

  uint64_t read_number(const Step& step, uint64_t row, uint64_t offset) {
    step.decode_reals(bytes_at(row, offset, step.value_bytes), 1, &numbers_[step.number]);
    return offset + step.value_bytes;
  }

  uint64_t read_list(const Step& step, uint64_t row, uint64_t offset) {
    const size_t count_bytes = bytes_of(step.count_type);
    const int64_t stored = count_at(bytes_at(row, offset, count_bytes), step.count_type);
    const uint64_t count = checked_count(stored, row, step.property);
    offset += count_bytes;
    if (step.property == requested_.indices) {
      index_count_ = static_cast<size_t>(count);
      step.decode_indices(bytes_at(row, offset, index_count_ * step.value_bytes), index_count_,
                          indices_.data());
    } else if (step.property == requested_.reals) {
      read_reals(step, row, offset, static_cast<size_t>(count));
    }
    return offset + count * step.value_bytes;
  }

  // Reads the list in parts, because it may be larger than the window.
  void read_reals(const Step& step, uint64_t row, uint64_t offset, size_t count) {
    constexpr size_t kPart = FileWindow::kBytes / sizeof(double);
    real_count_ = count;
    for (size_t i = 0; i < count; i += kPart) {
      const size_t n = std::min(kPart, count - i);
      step.decode_reals(bytes_at(row, offset + i * step.value_bytes, n * step.value_bytes), n,
                        reals_.data() + i);
    }
  }

  int64_t count_at(const std::byte* bytes, Type type) const {
    return with_type(type, [&]<class T>(T) {
      return static_cast<int64_t>(load_number<T>(bytes, is_big_endian_));
    });
  }

  const std::byte* bytes_at(uint64_t row, uint64_t offset, size_t size) {
    const auto bytes = window_.at(offset, size);
    if (bytes.size() < size) refuse_end(row);
    return bytes.data();
  }

  [[noreturn]] void refuse_end(uint64_t row) const {
    refuse(row, "is cut off: the file ends after " + std::to_string(file_.size()) + " bytes");
  }

  const bool is_big_endian_;
  FileWindow window_;
  std::vector<Step> steps_;
  size_t bytes_before_ = 0;  // bytes of a row after its last step
  bool is_plain_ = false;    // true if read_plain() can read the rows
};

}  // namespace

Rows::Rows(const ReadableFile& file, const Element& element, const RequestedProperties& requested,
           MemoryBudget& budget)
    : file_(file),
      element_(element),
      requested_(requested),
      indices_(budget, requested.indices == kNoProperty ? 0 : kMaxEntries,
               "a row of " + file.path()),
      reals_(budget, requested.reals == kNoProperty ? 0 : 2 * kMaxEntries,
             "a row of " + file.path()),
      numbers_(requested.numbers.size()) {}

size_t Rows::number_of(size_t property) const {
  const auto found = std::ranges::find(requested_.numbers, property);
  return found == requested_.numbers.end()
             ? kNoProperty
             : static_cast<size_t>(found - requested_.numbers.begin());
}

uint64_t Rows::checked_count(int64_t count, uint64_t row, size_t property) const {
  if (count < 0)
    refuse(row, "has a list of " + std::to_string(count) + " entries, expected 0 or more");
  const auto entries = static_cast<uint64_t>(count);
  const uint64_t corners = property == requested_.reals ? (entries + 1) / 2 : entries;
  const bool is_requested = property == requested_.indices || property == requested_.reals;
  if (is_requested && corners > kMaxEntries)
    throw Error(ErrorCode::kLimit, file_.path() + ": " + element_.name + " " + std::to_string(row) +
                                       " has " + std::to_string(corners) +
                                       " corners, the limit is " + std::to_string(kMaxEntries));
  if (entries > file_.size())
    refuse(row, "has a list of " + std::to_string(count) + " entries, expected less than the " +
                    std::to_string(file_.size()) + " bytes of the file");
  return entries;
}

void Rows::refuse(uint64_t row, const std::string& what) const {
  voxdag::refuse(file_.path(), printable(element_.name) + " " + std::to_string(row) + " " + what);
}

std::unique_ptr<Rows> open_rows(const ReadableFile& file, Format format, const Element& element,
                                const RequestedProperties& requested, MemoryBudget& budget) {
  if (format == Format::kAscii) return open_ascii_rows(file, element, requested, budget);
  return std::make_unique<BinaryRows>(file, format == Format::kBigEndian, element, requested,
                                      budget);
}

}  // namespace voxdag::ply
