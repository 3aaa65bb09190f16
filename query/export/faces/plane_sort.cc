#include "query/export/faces/plane_sort.h"

#include <algorithm>
#include <array>
#include <utility>

namespace voxdag::query {
namespace {

// For fewer faces than this, std::sort is faster than the radix sort.
constexpr size_t kFewFaces = 1024;
constexpr int kFaceDigitBits = 11;

struct FaceDigit {
  int shift, bits;
};
// The digits for the radix sort of the faces of one plane, lowest first: two for u and two for v.
constexpr std::array<FaceDigit, 4> kFaceDigits = {
    {{0, kFaceDigitBits},
     {kFaceDigitBits, kFaceCoordinateBits - kFaceDigitBits},
     {kFaceCoordinateBits, kFaceDigitBits},
     {kFaceCoordinateBits + kFaceDigitBits, kFaceCoordinateBits - kFaceDigitBits}}};

// One pass of the radix sort: copies `from` to `to`, ordered by one digit. Faces with equal digits
// keep their order.
void sort_faces_by_digit(std::span<const uint64_t> from, std::span<uint64_t> to, FaceDigit digit) {
  const auto of = [digit](uint64_t face) {
    return face >> digit.shift & ((uint64_t{1} << digit.bits) - 1);
  };
  std::array<uint64_t, size_t{1} << kFaceDigitBits> next{};
  for (const uint64_t face : from) ++next[of(face)];
  uint64_t sum = 0;
  for (uint64_t& at : next) sum += std::exchange(at, sum);
  for (const uint64_t face : from) to[next[of(face)]++] = face;
}

void sort_faces_of_plane(std::span<uint64_t> faces, std::span<uint64_t> scratch) {
  if (faces.size() < kFewFaces) {
    std::ranges::sort(faces);
    return;
  }
  uint64_t varying = 0;
  for (const uint64_t face : faces) varying |= face ^ faces[0];
  std::span<uint64_t> from = faces, to = scratch;
  for (const FaceDigit digit : kFaceDigits) {
    if ((varying >> digit.shift & ((uint64_t{1} << digit.bits) - 1)) == 0) continue;
    sort_faces_by_digit(from, to, digit);
    std::swap(from, to);
  }
  if (from.data() != faces.data()) std::ranges::copy(from, faces.begin());
}

}  // namespace

PlaneSort::PlaneSort(MemoryBudget& budget, uint64_t planes, const char* what)
    : budget_(budget),
      what_(what),
      ends_charge_(budget, (planes + 1) * sizeof(uint64_t), what),
      ends_(planes + 1) {}

void PlaneSort::reserve() {
  const uint64_t most = *std::ranges::max_element(ends_);
  for (size_t plane = 1; plane < ends_.size(); ++plane) ends_[plane] += ends_[plane - 1];
  faces_ = PageBuffer<uint64_t>(budget_, ends_.back(), what_);
  scratch_ = PageBuffer<uint64_t>(budget_, most, what_);
}

std::span<const uint64_t> PlaneSort::sort() {
  uint64_t begin = 0;
  for (const uint64_t end : ends_) {
    const uint64_t faces = end - std::min(begin, end);
    if (faces > 1) sort_faces_of_plane({&faces_[begin], faces}, {scratch_.data(), faces});
    begin = std::max(begin, end);
  }
  return {faces_.data(), faces_.size()};
}

}  // namespace voxdag::query
