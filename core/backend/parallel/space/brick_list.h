// The bricks of a subvolume, collected in parts. A brick is stored as its Morton code within the
// subvolume and its voxel mask.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

#include "core/backend/parallel/space/order.h"
#include "core/backend/parallel/space/space.h"

namespace voxdag::parallel {

// Sets flags[i] to 1 if codes[i] is the first code of its cube, otherwise to 0. Two codes are in
// the same cube if their bits from `shift` up are equal. The codes are sorted, so the codes of a
// cube are consecutive.
struct MarkFirstOfCube {
  const uint64_t* codes;
  int shift;
  uint8_t* flags;
  VOXDAG_HD void operator()(uint32_t i) const {
    flags[i] = i == 0 || codes[i] >> shift != codes[i - 1] >> shift;
  }
};

template <class Space>
class BrickList {
 public:
  // Codes have `code_bits` bits.
  BrickList(Space& space, int code_bits) : space_(space), code_bits_(code_bits) {}

  uint32_t size() const { return size_; }
  uint64_t* codes() { return codes_.data(); }
  uint64_t* masks() { return masks_.data(); }

  // Makes space for `count` bricks after the last brick, and returns the position at which this
  // space begins. commit() adds the bricks that were written there. If the arrays are full, first
  // merges duplicate bricks. If this frees too little space, the list grows.
  uint32_t reserve(uint32_t count) {
    if (size_ + uint64_t{count} <= codes_.size()) return size_;
    merge();
    const uint64_t needed = size_ + uint64_t{count};
    if (needed > codes_.size() / 4 * 3) grow(std::max(2 * needed, kMinSize));
    return size_;
  }
  // Adds `count` bricks, which were written at the position that reserve() returned. `sorted`: true
  // if their codes ascend without duplicates and are all above the codes of earlier bricks.
  void commit(uint32_t count, bool sorted) {
    sorted_ = sorted_ && sorted;
    size_ += count;
  }

  // Sorts by code and combines bricks with the same code into one.
  void merge() {
    if (sorted_ || size_ == 0) return;
    Order<Space> order(space_, size_);
    order.sort_by(KeyAt{codes_.data()}, {.begin = 0, .end = code_bits_});
    const auto sorted_codes = gather<uint64_t>(space_, size_, order.items(), codes_.data());
    const auto sorted_masks = gather<uint64_t>(space_, size_, order.items(), masks_.data());
    size_ = space_.merge_runs(sorted_codes.data(), sorted_masks.data(), size_, codes_.data(),
                              masks_.data());
    sorted_ = true;
  }

  SpaceArray<Space, uint64_t> take_codes() { return std::move(codes_); }
  SpaceArray<Space, uint64_t> take_masks() { return std::move(masks_); }

 private:
  static constexpr uint64_t kMinSize = 4096;

  void grow(uint64_t size) {
    codes_.grow(space_, size, size_);
    masks_.grow(space_, size, size_);
  }

  Space& space_;
  const int code_bits_;
  uint32_t size_ = 0;
  bool sorted_ = true;  // the codes ascend, and none occurs twice
  SpaceArray<Space, uint64_t> codes_, masks_;
};

}  // namespace voxdag::parallel
