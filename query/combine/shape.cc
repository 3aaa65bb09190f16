#include "query/combine/shape.h"

#include <algorithm>
#include <cmath>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/dag/brick.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kMixed = 0;          // any value except kNoNode and Shape::kFull
constexpr int kIndexBits = 20;          // bits of a position on one axis: kMaxGridLevels
constexpr double kMaxLength = 1 << 24;  // so that sums of squares have less than 64 bits

[[noreturn]] void refuse_shape(const std::string& text) {
  throw Error(ErrorCode::kInvalidInput,
              "shape '" + text +
                  "': expected, in voxels, sphere:X,Y,Z,R (multiples of 0.5 from -16777216 to "
                  "16777216, R at least 0) or box:X0,Y0,Z0,X1,Y1,Z1 (whole numbers, X0 < X1, "
                  "Y0 < Y1, Z0 < Z1)");
}

// Converts a number of voxels to half voxels. Refuses a number that is too large or not a multiple
// of 1/2.
int64_t halves_of(double number, const std::string& text) {
  if (!(std::abs(number) <= kMaxLength) || std::floor(2 * number) != 2 * number) refuse_shape(text);
  return static_cast<int64_t>(2 * number);
}

// Returns the position of a mixed cube on an axis, in units of its edge. `cube` is the cube's code
// (Shape::cube()).
constexpr int64_t cube_index(uint64_t cube, int axis) {
  return static_cast<int64_t>(cube >> kIndexBits * (2 - axis) & ((uint64_t{1} << kIndexBits) - 1));
}

constexpr int64_t squared(int64_t x) { return x * x; }

}  // namespace

Shape::Shape(const std::string& text) {
  const size_t colon = text.find(':');
  if (colon == std::string::npos) refuse_shape(text);
  const std::string kind = text.substr(0, colon), numbers = text.substr(colon + 1);
  if (kind == "box") {
    const auto box = parse_numbers<int64_t, 6>(numbers, ',');
    if (!box) refuse_shape(text);
    is_box_ = true;
    for (size_t axis = 0; axis < 3; ++axis) {
      low_[axis] = (*box)[axis];
      high_[axis] = (*box)[axis + 3] - 1;
      if (low_[axis] > high_[axis]) refuse_shape(text);
    }
    return;
  }
  const auto sphere = parse_numbers<double, 4>(numbers, ',');
  if (kind != "sphere" || !sphere || !((*sphere)[3] >= 0)) refuse_shape(text);
  for (size_t axis = 0; axis < 3; ++axis) center_[axis] = halves_of((*sphere)[axis], text);
  radius_ = halves_of((*sphere)[3], text);
}

uint64_t Shape::box_cover(const Position& low, const Position& high) const {
  bool is_full = true;
  for (size_t axis = 0; axis < 3; ++axis) {
    if (high[axis] < low_[axis] || low[axis] > high_[axis]) return kNoNode;
    is_full = is_full && low[axis] >= low_[axis] && high[axis] <= high_[axis];
  }
  return is_full ? kFull : kMixed;
}

// Computes in half voxels, so the center of voxel i is at 2i + 1.
uint64_t Shape::sphere_cover(const Position& low, const Position& high) const {
  // Squared distances from the sphere's center to the nearest and the farthest center of a voxel.
  int64_t nearest = 0, farthest = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    const int64_t first = 2 * low[axis] + 1 - center_[axis],
                  last = 2 * high[axis] + 1 - center_[axis];
    const int64_t near = first > 0 ? first : last < 0 ? last : first & 1;
    nearest += squared(near);
    farthest += std::max(squared(first), squared(last));
  }
  if (nearest > squared(radius_)) return kNoNode;
  return farthest <= squared(radius_) ? kFull : kMixed;
}

// Returns kNoNode for an empty cube, kFull for a full cube, and for a mixed cube a code of its
// position. `index` is the position of the cube, counted in cubes of this edge.
uint64_t Shape::cube(const Position& index, int64_t edge) const {
  Position low, high;
  uint64_t code = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    low[axis] = edge * index[axis];
    high[axis] = low[axis] + edge - 1;
    code = code << kIndexBits | static_cast<uint64_t>(index[axis]);
  }
  const uint64_t cover = is_box_ ? box_cover(low, high) : sphere_cover(low, high);
  return cover == kMixed ? code : cover;
}

std::array<uint64_t, 8> Shape::children(uint32_t levels, uint32_t level, uint64_t cube) const {
  const int64_t edge = int64_t{1} << (levels - level - 1);
  std::array<uint64_t, 8> children;
  for (int child = 0; child < 8; ++child) {
    Position index;
    for (int axis = 0; axis < 3; ++axis)
      index[static_cast<size_t>(axis)] = 2 * cube_index(cube, axis) + (child >> (2 - axis) & 1);
    children[static_cast<size_t>(child)] = this->cube(index, edge);
  }
  return children;
}

uint64_t Shape::brick(uint64_t cube) const {
  uint64_t mask = 0;
  for (int bit = 0; bit < 64; ++bit) {
    Position voxel;
    for (int axis = 0; axis < 3; ++axis)
      voxel[static_cast<size_t>(axis)] =
          kBrickEdge * cube_index(cube, axis) + brick_coordinate(bit, axis);
    const uint64_t cover = is_box_ ? box_cover(voxel, voxel) : sphere_cover(voxel, voxel);
    if (cover == kFull) mask |= uint64_t{1} << bit;
  }
  return mask;
}

}  // namespace voxdag::query
