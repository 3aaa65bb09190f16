#include "scene/points/text_points.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "core/color/surface.h"
#include "scene/points/light_table.h"
#include "scene/points/point_scene.h"
#include "scene/points/row_index.h"
#include "scene/points/row_reader.h"
#include "scene/surface_numbers.h"
#include "scene/text/characters.h"
#include "scene/text/other_formats.h"

namespace voxdag::points {
namespace {

constexpr uint64_t kSniffedBytes = uint64_t{64} << 10;

class TextFile : public PointFile {
 public:
  TextFile(std::unique_ptr<ReadableFile> file, const std::string& columns, MemoryBudget& budget,
           const CancelToken& cancel)
      : file_(std::move(file)), index_(*file_, columns, budget, cancel) {}

  const ReadableFile& file() const override { return *file_; }
  uint64_t count() const override { return index_.rows(); }
  bool has_colors() const override { return index_.columns().has_colors(); }
  bool has_columns() const override { return true; }
  std::unique_ptr<PointReader> open(unsigned readers, MemoryBudget& budget) const override;

  const RowIndex& index() const { return index_; }

 private:
  const std::unique_ptr<ReadableFile> file_;
  const RowIndex index_;
};

class TextReader : public PointReader {
 public:
  TextReader(const TextFile& file, MemoryBudget& budget)
      : index_(file.index()), rows_(file.file(), budget) {}

  void read(uint64_t first, size_t count, double* xyz) override {
    Columns::Values values{};
    for (const uint64_t end = first + count; first < end; ++first, xyz += 3) {
      if (go_to(first) && index_.columns().read(rows_.text(), values))
        std::copy_n(values.data(), 3, xyz);
      else
        std::fill_n(xyz, 3, std::numeric_limits<double>::quiet_NaN());
    }
  }

  void read_colors(uint64_t first, size_t count, Color* out) override {
    if (!light_) light_.emplace(uint16_t{255});
    Columns::Values values{};
    for (const uint64_t end = first + count; first < end; ++first, ++out)
      if (go_to(first) && index_.columns().read(rows_.text(), values))
        *out = {light_of(values[3]), light_of(values[4]), light_of(values[5]), kFullIntensity};
  }

  std::string fault_of(uint64_t point) override {
    if (!go_to(point))
      return "ends before row " + std::to_string(point) + ", expected a file that does not change";
    return "line " + std::to_string(rows_.place().line) + ": " +
           index_.columns().fault_of(rows_.text());
  }

 private:
  // Moves to the row with this number and reads it. Returns false if the file has become shorter
  // since it was opened.
  bool go_to(uint64_t row) {
    constexpr uint64_t kRows = RowIndex::kBlockRows;
    if (row < next_row_ || row / kRows != next_row_ / kRows || next_row_ % kRows == 0) {
      next_row_ = row / kRows * kRows;
      rows_.seek(index_.blocks()[static_cast<size_t>(row / kRows)]);
    }
    for (; next_row_ <= row; ++next_row_)
      if (!rows_.next()) return false;
    return true;
  }

  uint16_t light_of(double value) const {
    const double full = index_.full_color(), clamped = std::clamp(value, 0.0, full);
    const auto integer = static_cast<uint16_t>(clamped);
    return full == 255 && clamped == integer ? light_->of(integer) : linear_light(clamped / full);
  }

  const RowIndex& index_;
  RowReader rows_;
  uint64_t next_row_ = 0;  // the row that rows_ reads next
  std::optional<LightTable> light_;
};

std::unique_ptr<PointReader> TextFile::open(unsigned, MemoryBudget& budget) const {
  return std::make_unique<TextReader>(*this, budget);
}

bool ends_like_text_points(std::string_view path) {
  const size_t dot = path.rfind('.');
  if (dot == std::string_view::npos) return false;
  for (const char* ending : {".xyz", ".txt", ".csv"})
    if (equals_in_any_case(path.substr(dot), ending)) return true;
  return false;
}

// Returns the first line of `text` that is neither blank nor a comment, without blanks around it.
// Removes this line and all lines before it. Returns "" if there is no such line. The last line of
// `text` must have a line end unless `is_complete` is true.
std::string_view take_line(std::string_view& text, bool is_complete) {
  while (!text.empty()) {
    const size_t end = text.find_first_of("\r\n");
    if (end == std::string_view::npos && !is_complete) return {};
    const std::string_view line = trimmed(text.substr(0, end));
    text.remove_prefix(std::min(text.size(), end == std::string_view::npos ? end : end + 1));
    if (!is_comment(line)) return line;
  }
  return {};
}

}  // namespace

bool is_text_points(const ReadableFile& file) {
  std::string begin(std::min(file.size(), kSniffedBytes), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(begin)));
  const bool is_complete = begin.size() == file.size();
  std::string_view text = is_complete ? without_end_marks(begin) : begin;
  if (text.find('\0') != std::string_view::npos) return false;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  const std::string_view whole = text;
  const std::string_view first = take_line(text, is_complete);
  if (count_numbers(first) >= 3) return true;
  const auto columns = Columns::of_header(first);
  Columns::Values values{};
  if (columns && columns->read(take_line(text, is_complete), values)) return true;
  return ends_like_text_points(file.path()) && !first.starts_with('{') &&
         describe_other_format(whole).empty();
}

std::unique_ptr<TriangleSource> open_text_points(FileSystem&, std::unique_ptr<ReadableFile> file,
                                                 const SceneOptions& options, MemoryBudget& budget,
                                                 const CancelToken& cancel) {
  return make_point_scene(
      std::make_unique<TextFile>(std::move(file), options.columns, budget, cancel), options, budget,
      cancel);
}

}  // namespace voxdag::points
