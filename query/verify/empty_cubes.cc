#include "query/verify/empty_cubes.h"

namespace voxdag::query {

EmptyCubes::EmptyCubes(const voxdag_reader::File& file, int64_t edge, const VoxelPlace& center,
                       int radius)
    : center_(center),
      radius_(radius),
      side_(2 * static_cast<size_t>(radius) + 4),
      sums_(side_ * side_ * side_) {
  const int side = static_cast<int>(side_);
  const auto is_set = [&](int x, int y, int z) {
    const VoxelPlace at = {center[0] + x, center[1] + y, center[2] + z};
    for (const int64_t coordinate : at)
      if (coordinate < 0 || coordinate >= edge) return false;
    return file.voxel(at[0], at[1], at[2]);
  };
  for (int x = 1; x < side; ++x)
    for (int y = 1; y < side; ++y)
      for (int z = 1; z < side; ++z)
        sum(x, y, z) = is_set(x - radius - 2, y - radius - 2, z - radius - 2) + sum(x - 1, y, z) +
                       sum(x, y - 1, z) + sum(x, y, z - 1) - sum(x - 1, y - 1, z) -
                       sum(x - 1, y, z - 1) - sum(x, y - 1, z - 1) + sum(x - 1, y - 1, z - 1);
}

int EmptyCubes::count(const std::array<int, 3>& low, const std::array<int, 3>& high) const {
  int out = 0;
  for (int corner = 0; corner < 8; ++corner) {
    int at[3], sign = 1;
    for (int a = 0; a < 3; ++a) {
      const bool is_high = (corner >> a & 1) != 0;
      at[a] = is_high ? high[static_cast<size_t>(a)] : low[static_cast<size_t>(a)];
      if (!is_high) sign = -sign;
    }
    out += sign * sum(at[0], at[1], at[2]);
  }
  return out;
}

bool EmptyCubes::is_empty(const std::array<int, 3>& low) const {
  return count(low, {low[0] + radius_ + 1, low[1] + radius_ + 1, low[2] + radius_ + 1}) == 0;
}

bool EmptyCubes::has_center() const {
  for (int x = 1; x <= radius_ + 1; ++x)
    for (int y = 1; y <= radius_ + 1; ++y)
      for (int z = 1; z <= radius_ + 1; ++z)
        if (is_empty({x, y, z})) return true;
  return false;
}

EmptyCubes::Step EmptyCubes::step_from(int axis, int side) const {
  const auto a = static_cast<size_t>(axis), b = (a + 1) % 3, c = (a + 2) % 3;
  const int middle = radius_ + 1;  // position of the center in the block, along each axis
  // For each voxel of the center's layer, by position along the axes b and c: 1 if an empty cube
  // that steps into this layer would move over the voxel.
  std::vector<uint8_t> is_in_path(side_ * side_);
  Step out;
  std::array<int, 3> low;
  low[a] = side > 0 ? middle + 1 : 0;
  for (low[b] = 1; low[b] <= middle; ++low[b])
    for (low[c] = 1; low[c] <= middle; ++low[c]) {
      if (!is_empty(low)) continue;
      out.has_cubes = true;
      for (int i = 0; i <= radius_; ++i)
        for (int j = 0; j <= radius_; ++j)
          is_in_path[static_cast<size_t>(low[b] + i) * side_ + static_cast<size_t>(low[c] + j)] = 1;
    }
  std::array<int, 3> at;
  at[a] = middle;
  for (at[b] = 1; at[b] <= 2 * radius_ + 1; ++at[b])
    for (at[c] = 1; at[c] <= 2 * radius_ + 1; ++at[c])
      if (is_in_path[static_cast<size_t>(at[b]) * side_ + static_cast<size_t>(at[c])] != 0 &&
          count(at, {at[0] + 1, at[1] + 1, at[2] + 1}) != 0)
        out.stops.push_back({center_[0] + at[0] - middle, center_[1] + at[1] - middle,
                             center_[2] + at[2] - middle});
  return out;
}

}  // namespace voxdag::query
