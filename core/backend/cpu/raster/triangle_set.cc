#include "core/backend/cpu/raster/triangle_set.h"

namespace voxdag::cpu {

void TriangleSet::add(const WideTriangle& triangle) {
  const bool narrow = is_narrow(triangle);
  uint32_t& count = narrow ? narrow_count_ : wide_count_;
  if (count + 1 >= Entry::kWide) throw OutOfBudget{};
  if (narrow) {
    if (count + 2 > narrow_.size()) narrow_.grow(memory_, count + 2);
    narrow_[count] = narrowed(triangle);
  } else {
    if (count + 1 > wide_.size()) wide_.grow(memory_, count + 1);
    wide_[count] = triangle;
  }
  ++count;
}

void TriangleSet::clear() {
  narrow_ = {};
  wide_ = {};
  narrow_count_ = wide_count_ = 0;
}

}  // namespace voxdag::cpu
