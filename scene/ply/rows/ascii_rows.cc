#include "scene/messages.h"
#include "scene/ply/rows/numbers.h"
#include "scene/ply/rows/rows.h"
#include "scene/text/word_scanner.h"

namespace voxdag::ply {
namespace {

class AsciiRows : public Rows {
 public:
  AsciiRows(const ReadableFile& file, const Element& element, const RequestedProperties& requested,
            MemoryBudget& budget)
      : Rows(file, element, requested, budget), text_(file, budget) {
    for (size_t i = 0; i < element.properties.size(); ++i) number_of_.push_back(number_of(i));
  }

  uint64_t read(uint64_t row, uint64_t offset) override {
    index_count_ = real_count_ = 0;
    text_.begin_row(offset);
    for (size_t i = 0; i < element_.properties.size(); ++i)
      if (element_.properties[i].is_list)
        read_list(i, row);
      else
        read_number(i, row);
    if (!text_.end_row()) note_irregular(row, "has more on its line than its properties");
    return text_.offset();
  }

 private:
  void read_number(size_t property, uint64_t row) {
    const std::string_view text = word(row);
    if (number_of_[property] != RequestedProperties::kNone)
      numbers_[number_of_[property]] = number(text, property, row);
  }

  void read_list(size_t property, uint64_t row) {
    const uint64_t count = checked_count(integer(row), row, property);
    for (uint64_t k = 0; k < count; ++k)
      if (property == requested_.indices)
        indices_[index_count_++] = as_index(integer(row));
      else if (property == requested_.reals)
        reals_[real_count_++] = number(word(row), property, row);
      else
        word(row);
  }

  std::string_view word(uint64_t row) {
    std::string_view text = text_.word();
    if (!text.empty()) return text;
    note_irregular(row, "has too few values on its line");
    text_.begin_row(text_.offset());
    text = text_.word();
    if (text.empty()) refuse(row, "has too few values, expected one for each property");
    return text;
  }
  int64_t integer(uint64_t row) {
    const std::string_view text = word(row);
    if (const auto value = parse_whole_number(text)) return *value;
    refuse(row, "has " + printable(text) + ", expected an integer");
  }
  double number(std::string_view text, size_t property, uint64_t row) const {
    if (const auto value = parse_number(text, element_.properties[property].type)) return *value;
    refuse(row, "has " + printable(text) + ", expected a number");
  }

  void note_irregular(uint64_t row, const char* what) {
    if (first_irregular_.empty())
      first_irregular_ = printable(element_.name) + " " + std::to_string(row) + " " + what;
  }

  std::vector<size_t> number_of_;  // position of each property in numbers()
  WordScanner text_;
};

}  // namespace

std::unique_ptr<Rows> open_ascii_rows(const ReadableFile& file, const Element& element,
                                      const RequestedProperties& requested, MemoryBudget& budget) {
  return std::make_unique<AsciiRows>(file, element, requested, budget);
}

}  // namespace voxdag::ply
