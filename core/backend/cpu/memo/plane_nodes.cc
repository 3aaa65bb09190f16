#include "core/backend/cpu/memo/plane_nodes.h"

#include <utility>

namespace voxdag::cpu {
namespace {

// Merges the sorted values `a`, and the sorted values `b` plus `shift`. Returns the end of the
// result. The loop has no branch that depends on the values, because the CPU would often mispredict
// it.
int64_t* merge_shifted(std::span<const int64_t> a, std::span<const int64_t> b, int64_t shift,
                       int64_t* out) {
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    const int64_t from_a = a[i], from_b = b[j] + shift;
    const bool is_b = from_b < from_a;
    *out++ = is_b ? from_b : from_a;
    j += is_b ? 1 : 0;
    i += is_b ? 0 : 1;
  }
  out = std::copy(a.begin() + static_cast<std::ptrdiff_t>(i), a.end(), out);
  for (; j < b.size(); ++j) *out++ = b[j] + shift;
  return out;
}

}  // namespace

void sort_corner_values(const int64_t* n, int size_log2, std::span<int64_t> values,
                        std::span<int64_t> other) {
  constexpr size_t kMaxFace = 17 * 17;
  int64_t face[kMaxFace];
  std::span<int64_t> from = values, to = other;
  size_t count = 1;
  from[0] = 0;
  // Each step adds the corners of one more axis: the sorted values so far, plus the multiples 0 to
  // 2^size_log2 of the axis's component. It doubles the number of multiples until only the last
  // one is missing.
  for (int a = 0; a < 3; ++a) {
    const size_t face_count = count;
    std::copy(from.begin(), from.begin() + static_cast<std::ptrdiff_t>(count), face);
    for (int log2 = 0; log2 <= size_log2; ++log2) {
      const auto low = from.first(count);
      const auto high = log2 < size_log2 ? std::span<const int64_t>(low)
                                         : std::span<const int64_t>(face, face_count);
      count = static_cast<size_t>(
          merge_shifted(low, high, -n[a] * (int64_t{1} << log2), to.data()) - to.data());
      std::swap(from, to);
    }
  }
  if (from.data() != values.data()) std::copy(from.begin(), from.end(), values.begin());
}

}  // namespace voxdag::cpu
