#include "scene/points/las_points.h"

#include <algorithm>
#include <deque>
#include <optional>
#include <string>
#include <utility>

#include "core/color/surface.h"
#include "scene/growing_charge.h"
#include "scene/messages.h"
#include "scene/points/las_header.h"
#include "scene/points/light_table.h"
#include "scene/points/point_scene.h"
#include "scene/text/file_window.h"

namespace voxdag::points {
namespace {

// Maximum number of records that are read from the FileWindow in one step.
constexpr uint64_t kLasWindowRecords = 1024;
// Records per block. LasFile stores the number of points that are not withheld before each block.
constexpr uint64_t kLasBlockRecords = 1024;

// Calls visit(number, bytes) for each of the records [first, first + count).
template <class Visit>
void for_each_record(FileWindow& window, const LasHeader& las, uint64_t first, uint64_t count,
                     const Visit& visit) {
  const uint64_t in_window = FileWindow::kBytes / las.record_bytes;
  for (const uint64_t end = first + count; first < end;) {
    const uint64_t n = std::min({end - first, in_window, kLasWindowRecords});
    const auto bytes = window.at(las.data_begin + first * las.record_bytes,
                                 static_cast<size_t>(n * las.record_bytes));
    const std::byte* record = bytes.data();
    for (uint64_t i = 0; i < n; ++i, record += las.record_bytes) visit(first + i, record);
    first += n;
  }
}

class LasFile : public PointFile {
 public:
  LasFile(std::unique_ptr<ReadableFile> file, MemoryBudget& budget, const CancelToken& cancel)
      : file_(std::move(file)),
        las_(read_las_header(*file_)),
        count_(las_.records),
        charge_(budget, "the withheld points of " + file_->path()) {
    pass_over(budget, cancel);
  }

  const ReadableFile& file() const override { return *file_; }
  uint64_t count() const override { return count_; }
  bool has_colors() const override { return las_.color_offset != LasHeader::kNoColor; }
  std::vector<Warning> warnings() const override {
    if (count_ == las_.records) return {};
    return {
        {"withheld-points", file_->path(), "withheld points are left out", las_.records - count_}};
  }
  std::unique_ptr<PointReader> open(unsigned readers, MemoryBudget& budget) const override;

  const LasHeader& las() const { return las_; }
  bool has_withheld() const { return count_ != las_.records; }
  // Returns the value of full intensity of a color: 255 if no color of the file is larger,
  // otherwise 65535.
  uint16_t max_color() const { return max_color_; }
  // Returns the first record of the block that contains `point`, and the number of points before
  // this block. Withheld records do not count as points.
  std::pair<uint64_t, uint64_t> block_of(uint64_t point) const {
    const auto after = std::ranges::upper_bound(kept_before_, point);
    const auto block = after - kept_before_.begin() - 1;
    return {static_cast<uint64_t>(block) * kLasBlockRecords,
            kept_before_[static_cast<size_t>(block)]};
  }

 private:
  void pass_over(MemoryBudget& budget, const CancelToken& cancel);

  const std::unique_ptr<ReadableFile> file_;
  const LasHeader las_;
  uint64_t count_;  // points that are not withheld
  uint16_t max_color_ = 255;
  std::deque<uint64_t> kept_before_;  // number of kept points before each block of records
  GrowingCharge charge_;              // charge for kept_before_
};

// Counts the points that are not withheld, and finds max_color_.
void LasFile::pass_over(MemoryBudget& budget, const CancelToken& cancel) {
  FileWindow window(*file_, budget);
  uint64_t kept = 0;
  uint16_t all_colors = 0;  // all colors, combined by "or"
  for_each_record(window, las_, 0, las_.records, [&](uint64_t number, const std::byte* record) {
    if (number % kLasBlockRecords == 0) {
      cancel.check();
      charge_.add(sizeof(uint64_t));
      kept_before_.push_back(kept);
    }
    if (las_.is_withheld(record)) return;
    ++kept;
    if (has_colors())
      for (size_t c = 0; c < 3; ++c)
        all_colors |= load_little_endian<uint16_t>(record + las_.color_offset + 2 * c);
  });
  count_ = kept;
  max_color_ = all_colors > 255 ? 65535 : 255;
}

class LasReader : public PointReader {
 public:
  LasReader(const LasFile& file, MemoryBudget& budget)
      : file_(file), las_(file.las()), window_(file.file(), budget) {}

  void read(uint64_t first, size_t count, double* xyz) override {
    for_each_point(first, count, [&](const std::byte* record) {
      for (size_t a = 0; a < 3; ++a)
        *xyz++ = static_cast<double>(load_little_endian<int32_t>(record + 4 * a)) * las_.scale[a] +
                 las_.offset[a];
    });
  }

  void read_colors(uint64_t first, size_t count, Color* out) override {
    if (!light_) light_.emplace(file_.max_color());
    for_each_point(first, count, [&](const std::byte* record) {
      for (size_t c = 0; c < 3; ++c)
        (*out)[c] = light_->of(load_little_endian<uint16_t>(record + las_.color_offset + 2 * c));
      (*out++)[3] = kFullIntensity;
    });
  }

  std::string fault_of(uint64_t point) override {
    return "point " + std::to_string(point) + not_finite();
  }

 private:
  // Calls visit(record) for points [first, first + count). Withheld records do not count as points.
  template <class Visit>
  void for_each_point(uint64_t first, size_t count, const Visit& visit) {
    if (!file_.has_withheld())
      return for_each_record(window_, las_, first, count,
                             [&](uint64_t, const std::byte* record) { visit(record); });
    const auto [first_record, first_point] = file_.block_of(first);
    uint64_t begin = first_record, point = first_point;  // structured bindings cannot be captured
    const uint64_t end = first + count;
    for (; point < end && begin < las_.records; begin += kLasBlockRecords) {
      const uint64_t records = std::min(kLasBlockRecords, las_.records - begin);
      for_each_record(window_, las_, begin, records, [&](uint64_t, const std::byte* record) {
        if (las_.is_withheld(record)) return;
        if (point >= first && point < end) visit(record);
        ++point;
      });
    }
  }

  const LasFile& file_;
  const LasHeader& las_;
  FileWindow window_;
  std::optional<LightTable> light_;
};

std::unique_ptr<PointReader> LasFile::open(unsigned, MemoryBudget& budget) const {
  return std::make_unique<LasReader>(*this, budget);
}

}  // namespace

std::unique_ptr<TriangleSource> open_las(FileSystem&, std::unique_ptr<ReadableFile> file,
                                         const SceneOptions& options, MemoryBudget& budget,
                                         const CancelToken& cancel) {
  return make_point_scene(std::make_unique<LasFile>(std::move(file), budget, cancel), options,
                          budget, cancel);
}

}  // namespace voxdag::points
