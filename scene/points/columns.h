// The columns of a text file with points, and the fields of its rows.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace voxdag::points {

// Splits a row into fields. A row with a semicolon is separated by semicolons; otherwise, a row
// with a comma is separated by commas; any other row is separated by blanks and tabs. Blanks around
// a field, and double quotes around it, do not belong to the field.
class FieldScanner {
 public:
  explicit FieldScanner(std::string_view row);
  // Returns the next field, valid as long as the row; nullopt after the last one.
  std::optional<std::string_view> next();

 private:
  std::string_view row_;
  char separator_;  // ' ' stands for blanks and tabs
  bool is_done_ = false;
};

class Columns {
 public:
  // The values of a point are numbered in the order x, y, z, red, green, blue.
  static constexpr size_t kValues = 6;
  static constexpr size_t kNone = ~size_t{0};
  static constexpr const char* kExpected =
      "the names x, y and z, optionally r, g and b, and _ for columns that are not used, with "
      "commas between them, such as x,y,z,_,r,g,b";
  using Values = std::array<double, kValues>;

  // Parses a list such as "x,y,z,_,r,g,b". The names are the same as in a header line, in upper or
  // lower case; "_" is a column that is not used. Returns nullopt unless x, y and z each occur
  // once, and the colors all occur once or not at all.
  static std::optional<Columns> parse(std::string_view list);
  // Like parse(), but throws Error{kInvalidInput} for an invalid list.
  static Columns given(std::string_view list);
  // Returns the columns that a header line names: x, y, z; r, g, b or red, green, blue. Ignores all
  // other names. Returns nullopt without x, y and z.
  static std::optional<Columns> of_header(std::string_view row);
  // Returns the columns x, y, z, followed by the three colors if `has_colors`.
  static Columns standard(bool has_colors);

  bool has_colors() const { return place_[3] != kNone; }
  // Reads the values of a row. Colors are read only if the columns have them. Returns false for a
  // row that has too few fields, or whose field in one of these columns is not a finite number.
  bool read(std::string_view row, Values& out) const;
  // True if a color of the row is written with a decimal point or an exponent.
  bool has_color_fraction(std::string_view row) const;
  // Returns the reason why read() returns false, for messages.
  std::string fault_of(std::string_view row) const;
  // True if no named column of the row holds a number, as in a header line.
  bool has_no_number(std::string_view row) const;

 private:
  Columns() { place_.fill(kNone); }
  void finish();

  std::array<size_t, kValues> place_;  // number of the column of each value
  std::vector<size_t> value_in_;       // value number of each column, up to the last used column
};

// Returns the number of fields of a row if all of them are numbers, otherwise 0.
size_t count_numbers(std::string_view row);

}  // namespace voxdag::points
