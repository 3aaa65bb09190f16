#include "scene/points/columns.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/error.h"
#include "scene/messages.h"
#include "scene/text/characters.h"
#include "scene/text/numbers.h"

namespace voxdag::points {
namespace {

constexpr const char* kValueNames[] = {"x", "y", "z", "r", "g", "b"};
constexpr const char* kLongNames[] = {"x", "y", "z", "red", "green", "blue"};

// Returns the number of the value with this name, or kNone.
size_t value_named(std::string_view name) {
  for (size_t v = 0; v < Columns::kValues; ++v)
    if (equals_in_any_case(name, kValueNames[v]) || equals_in_any_case(name, kLongNames[v]))
      return v;
  return Columns::kNone;
}

// Returns the position of the first separator outside of quotes.
size_t find_separator(std::string_view row, char separator) {
  bool is_quoted = false;
  for (size_t i = 0; i < row.size(); ++i) {
    if (row[i] == '"') is_quoted = !is_quoted;
    if (row[i] == separator && !is_quoted) return i;
  }
  return std::string_view::npos;
}

bool has_separator(std::string_view row, char separator) {
  const size_t first = row.find(separator);
  if (first == std::string_view::npos) return false;
  return row.find('"') > first || find_separator(row, separator) != std::string_view::npos;
}

std::string_view without_quotes(std::string_view field) {
  field = trimmed(field);
  if (field.size() < 2 || field.front() != '"' || field.back() != '"') return field;
  return trimmed(field.substr(1, field.size() - 2));
}

bool read_value(std::string_view field, double& out) {
  const auto value = parse_real<double>(field);
  if (!value || !std::isfinite(*value)) return false;
  out = *value;
  return true;
}

}  // namespace

FieldScanner::FieldScanner(std::string_view row)
    : row_(trimmed(row)),
      separator_(has_separator(row, ';')   ? ';'
                 : has_separator(row, ',') ? ','
                                           : ' '),
      is_done_(row_.empty()) {}

std::optional<std::string_view> FieldScanner::next() {
  if (is_done_) return std::nullopt;
  if (separator_ == ' ') {
    const std::string_view word = next_word(row_);
    is_done_ = row_.empty();
    return without_quotes(word);
  }
  const bool has_quotes = row_.find('"') != std::string_view::npos;
  const size_t end = has_quotes ? find_separator(row_, separator_) : row_.find(separator_);
  const std::string_view field = row_.substr(0, end);
  is_done_ = end == std::string_view::npos;
  if (!is_done_) row_.remove_prefix(end + 1);
  return without_quotes(field);
}

std::optional<Columns> Columns::parse(std::string_view list) {
  Columns columns;
  for (size_t column = 0, begin = 0; begin <= list.size(); ++column) {
    const size_t end = std::min(list.find(',', begin), list.size());
    const std::string_view name = trimmed(list.substr(begin, end - begin));
    begin = end + 1;
    if (name == "_") continue;
    const size_t value = value_named(name);
    if (value == kNone || columns.place_[value] != kNone) return std::nullopt;
    columns.place_[value] = column;
  }
  const auto is_missing = [&](size_t v) { return columns.place_[v] == kNone; };
  if (is_missing(0) || is_missing(1) || is_missing(2)) return std::nullopt;
  if (is_missing(3) != is_missing(4) || is_missing(3) != is_missing(5)) return std::nullopt;
  columns.finish();
  return columns;
}

Columns Columns::given(std::string_view list) {
  if (auto columns = parse(list)) return *std::move(columns);
  throw Error(ErrorCode::kInvalidInput,
              "\"" + printable(list) + "\" does not name columns, expected " + kExpected);
}

std::optional<Columns> Columns::of_header(std::string_view row) {
  Columns columns;
  FieldScanner fields(row);
  size_t column = 0;
  for (auto name = fields.next(); name; name = fields.next(), ++column) {
    const size_t value = value_named(*name);
    if (value != kNone && columns.place_[value] == kNone) columns.place_[value] = column;
  }
  for (size_t v = 0; v < 3; ++v)
    if (columns.place_[v] == kNone) return std::nullopt;
  if (std::ranges::count(columns.place_, kNone) > 0)
    std::fill(columns.place_.begin() + 3, columns.place_.end(), kNone);
  columns.finish();
  return columns;
}

Columns Columns::standard(bool has_colors) {
  Columns columns;
  for (size_t v = 0; v < (has_colors ? kValues : 3); ++v) columns.place_[v] = v;
  columns.finish();
  return columns;
}

bool Columns::read(std::string_view row, Values& out) const {
  FieldScanner fields(row);
  for (const size_t value : value_in_) {
    const auto field = fields.next();
    if (!field || (value != kNone && !read_value(*field, out[value]))) return false;
  }
  return true;
}

std::string Columns::fault_of(std::string_view row) const {
  FieldScanner fields(row);
  for (size_t column = 0; column < value_in_.size(); ++column) {
    const auto field = fields.next();
    if (!field)
      return "has " + std::to_string(column) + " columns, expected " +
             std::to_string(value_in_.size()) + " or more: \"" + printable(row) + "\"";
    const size_t value = value_in_[column];
    double number = 0;
    if (value != kNone && !read_value(*field, number))
      return "has \"" + printable(*field) + "\" in column " + std::to_string(column + 1) + " (" +
             kValueNames[value] + "), expected a finite number: \"" + printable(row) + "\"";
  }
  return "has no fault";
}

bool Columns::has_color_fraction(std::string_view row) const {
  FieldScanner fields(row);
  for (const size_t value : value_in_) {
    const auto field = fields.next();
    if (!field) break;
    if (value != kNone && value >= 3 && field->find_first_of(".eE") != std::string_view::npos)
      return true;
  }
  return false;
}

bool Columns::has_no_number(std::string_view row) const {
  FieldScanner fields(row);
  for (const size_t value : value_in_) {
    const auto field = fields.next();
    if (!field) break;
    if (value != kNone && parse_real<double>(*field)) return false;
  }
  return true;
}

// Sets value_in_ from place_.
void Columns::finish() {
  for (size_t v = 0; v < kValues; ++v) {
    if (place_[v] == kNone) continue;
    if (value_in_.size() <= place_[v]) value_in_.resize(place_[v] + 1, kNone);
    value_in_[place_[v]] = v;
  }
}

size_t count_numbers(std::string_view row) {
  FieldScanner fields(row);
  size_t count = 0;
  for (auto field = fields.next(); field; field = fields.next(), ++count)
    if (!parse_real<double>(*field)) return 0;
  return count;
}

}  // namespace voxdag::points
