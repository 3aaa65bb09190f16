#include "merge/load/position_maps.h"

#include <algorithm>

namespace voxdag {

PositionMaps::PositionMaps(std::span<const uint64_t> rows, uint64_t resident_bytes,
                           ScratchFolder& scratch, MemoryBudget& budget)
    : first_{0} {
  for (const uint64_t count : rows) first_.push_back(first_.back() + count);
  if (total_rows() * sizeof(uint32_t) <= resident_bytes)
    values_ = PageBuffer<uint32_t>(budget, total_rows(), "the merge's position maps");
  else
    file_ = std::make_shared<ScratchFile>(scratch);
}

PositionMaps::PositionMaps(std::span<const uint64_t> rows, std::unique_ptr<ScratchFile> file,
                           uint64_t resident_bytes, MemoryBudget& budget)
    : first_{0}, file_(std::move(file)) {
  for (const uint64_t count : rows) first_.push_back(first_.back() + count);
  if (total_rows() * sizeof(uint32_t) > resident_bytes) return;
  values_ = PageBuffer<uint32_t>(budget, total_rows(), "the merge's position maps");
  file_->read(0, {values_.data(), values_.size()});
  file_.reset();
}

std::shared_ptr<ScratchFile> PositionMaps::file(ScratchFolder& scratch) const {
  if (file_) return file_;
  auto copy = std::make_shared<ScratchFile>(scratch);
  copy->write(0, {values_.data(), values_.size()});
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

void PositionMaps::store(size_t run, uint64_t first, std::span<const uint32_t> positions) {
  if (resident())
    std::copy(positions.begin(), positions.end(), values(run) + first);
  else
    file_->write(first_[run] + first, positions);
}

void PositionMaps::load(size_t run, uint64_t first, std::span<uint32_t> positions) const {
  if (resident())
    std::copy_n(values(run) + first, positions.size(), positions.begin());
  else
    file_->read(first_[run] + first, positions);
}

uint32_t PositionMaps::at(size_t run, uint64_t row) const {
  uint32_t position = 0;
  load(run, row, {&position, 1});
  return position;
}

}  // namespace voxdag
