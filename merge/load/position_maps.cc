#include "merge/load/position_maps.h"

#include <algorithm>

#include "merge/load/row.h"

namespace voxdag {
namespace {

// Returns, for each run, the number of rows in all runs before it. The last item is the number of
// all rows.
std::vector<uint64_t> begins_of(std::span<const uint64_t> rows) {
  std::vector<uint64_t> begins{0};
  for (const uint64_t count : rows) begins.push_back(begins.back() + count);
  return begins;
}

}  // namespace

PositionMaps::PositionMaps(std::span<const uint64_t> rows, bool wide, uint64_t resident_bytes,
                           ScratchFolder& scratch, MemoryBudget& budget)
    : first_(begins_of(rows)), wide_(wide) {
  if (total_words() * sizeof(uint32_t) <= resident_bytes)
    words_ = PageBuffer<uint32_t>(budget, total_words(), "the merge's position maps");
  else
    file_ = std::make_shared<ScratchFile>(scratch);
}

PositionMaps::PositionMaps(std::span<const uint64_t> rows, std::unique_ptr<ScratchFile> file,
                           uint64_t resident_bytes, MemoryBudget& budget)
    : first_(begins_of(rows)), wide_(file->state().words > first_.back()), file_(std::move(file)) {
  if (total_words() * sizeof(uint32_t) > resident_bytes) return;
  words_ = PageBuffer<uint32_t>(budget, total_words(), "the merge's position maps");
  file_->read(0, {words_.data(), words_.size()});
  file_.reset();
}

std::shared_ptr<ScratchFile> PositionMaps::file(ScratchFolder& scratch) const {
  if (file_) return file_;
  auto copy = std::make_shared<ScratchFile>(scratch);
  copy->write(0, {words_.data(), words_.size()});
  return copy;
}

std::vector<uint64_t> PositionMaps::rows() const {
  std::vector<uint64_t> all;
  for (size_t run = 0; run + 1 < first_.size(); ++run) all.push_back(rows(run));
  return all;
}

uint64_t PositionMaps::max_rows() const {
  uint64_t max = 0;
  for (size_t run = 0; run + 1 < first_.size(); ++run) max = std::max(max, rows(run));
  return max;
}

void PositionMaps::store(size_t run, uint64_t first, std::span<const uint32_t> words) {
  if (is_resident())
    std::ranges::copy(words, this->words(run) + (first << wide_));
  else
    file_->write(first_word(run) + (first << wide_), words);
}

void PositionMaps::load(size_t run, uint64_t first, std::span<uint32_t> words) const {
  if (is_resident())
    std::copy_n(this->words(run) + (first << wide_), words.size(), words.begin());
  else
    file_->read(first_word(run) + (first << wide_), words);
}

uint64_t PositionMaps::at(size_t run, uint64_t row) const {
  uint32_t words[2] = {};
  load(run, row, std::span(words).first(position_words()));
  return get_position(words, wide_);
}

}  // namespace voxdag
