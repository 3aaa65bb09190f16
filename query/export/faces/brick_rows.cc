#include "query/export/faces/brick_rows.h"

#include <algorithm>
#include <array>
#include <utility>

namespace voxdag::query {
namespace {

// For fewer bricks than this, std::sort is faster than the radix sort.
constexpr size_t kFewBricks = 1024;
constexpr int kKeyDigitBits = 10;

struct KeyDigit {
  int shift, bits;
};
// The digits of a key for the radix sort, lowest first: two for each coordinate. The order of the
// flags does not matter, because no two bricks have the same position.
constexpr std::array<KeyDigit, 6> kKeyDigits = [] {
  std::array<KeyDigit, 6> digits{};
  for (size_t i = 0; i < 6; ++i) {
    const int begin = RowBrick::kFlagBits + static_cast<int>(i / 2) * RowBrick::kCoordinateBits;
    digits[i] = i % 2 == 0
                    ? KeyDigit{begin, kKeyDigitBits}
                    : KeyDigit{begin + kKeyDigitBits, RowBrick::kCoordinateBits - kKeyDigitBits};
  }
  return digits;
}();

void sort_bricks_by_digit(std::span<const RowBrick> from, std::span<RowBrick> to, KeyDigit digit) {
  const auto of = [digit](const RowBrick& brick) {
    return brick.key >> digit.shift & ((uint64_t{1} << digit.bits) - 1);
  };
  std::array<uint64_t, size_t{1} << kKeyDigitBits> next{};
  for (const RowBrick& brick : from) ++next[of(brick)];
  uint64_t sum = 0;
  for (uint64_t& at : next) sum += std::exchange(at, sum);
  for (const RowBrick& brick : from) to[next[of(brick)]++] = brick;
}

}  // namespace

BrickRows::BrickRows(MemoryBudget& budget, uint64_t bricks, uint64_t cube_sides,
                     std::string_view what)
    : bricks_(budget, bricks + 2 * cube_sides, what),
      scratch_(budget, bricks + 2 * cube_sides, what) {}

void BrickRows::add(const Position& low, uint64_t mask) {
  const auto at = [&](size_t axis) { return static_cast<uint64_t>(low[axis] / kBrickEdge); };
  // The key is for axis 2; sorted(0) converts it to axis 0.
  bricks_[singles_++] = {RowBrick::key_of(at(2), at(1), at(0)), mask};
}

void BrickRows::add_full_cube(const Position& low, int64_t edge) {
  cubes_.push_back(
      {{low[0] / kBrickEdge, low[1] / kBrickEdge, low[2] / kBrickEdge}, edge / kBrickEdge});
}

// Changes the keys of single bricks to the next axis. The axis of a slab becomes the axis of v, and
// the axis of u becomes the axis of the slab.
void BrickRows::turn_keys() {
  if (bricks_.size() == 0) return;
  RowBrick* kept = bricks_.begin();
  for (const RowBrick& brick : std::span(bricks_.data(), size_))
    if (brick.has_faces(true) && brick.has_faces(false))
      *kept++ = {RowBrick::key_of(brick.u(), brick.slab(), brick.v()), brick.mask};
}

void BrickRows::add_sides(const Cube& cube, int axis) {
  const auto a = static_cast<size_t>(axis);
  const auto slab = static_cast<uint64_t>(cube.low[a]);
  const auto u = static_cast<uint64_t>(cube.low[(a + 1) % 3]);
  const auto v = static_cast<uint64_t>(cube.low[(a + 2) % 3]);
  const auto edge = static_cast<uint64_t>(cube.edge);
  for (uint64_t j = v; j < v + edge; ++j)
    for (uint64_t i = u; i < u + edge; ++i) {
      bricks_[size_++] = {RowBrick::key_of(slab, j, i, RowBrick::kNoUpperFaces), ~uint64_t{0}};
      bricks_[size_++] = {RowBrick::key_of(slab + edge - 1, j, i, RowBrick::kNoLowerFaces),
                          ~uint64_t{0}};
    }
}

std::span<const RowBrick> BrickRows::sorted(int axis) {
  if (axis == 0) size_ = singles_;
  turn_keys();
  size_ = singles_;
  for (const Cube& cube : cubes_) add_sides(cube, axis);
  sort();
  return {bricks_.data(), size_};
}

void BrickRows::sort() {
  const std::span<RowBrick> all(bricks_.data(), size_);
  if (all.size() < kFewBricks) {
    std::ranges::sort(all, {}, &RowBrick::key);
    return;
  }
  uint64_t varying = 0;
  for (const RowBrick& brick : all) varying |= brick.key ^ all[0].key;
  for (const KeyDigit digit : kKeyDigits) {
    if ((varying >> digit.shift & ((uint64_t{1} << digit.bits) - 1)) == 0) continue;
    sort_bricks_by_digit({bricks_.data(), size_}, {scratch_.data(), size_}, digit);
    std::swap(bricks_, scratch_);
  }
}

}  // namespace voxdag::query
