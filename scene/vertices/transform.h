// Affine transforms of glTF nodes. Uses only + - * / of IEEE doubles, in an order fixed by
// parentheses, so that all machines get the same bits. docs/scenes.md has the formulas.
#pragma once

#include <array>

namespace voxdag {

// The upper three rows of a 4x4 matrix. The last row is 0 0 0 1.
struct Transform {
  double m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
};

// Returns the transform that applies `inner` first, then `outer`.
inline Transform multiply(const Transform& outer, const Transform& inner) {
  Transform product;
  for (int i = 0; i < 3; ++i) {
    const double* row = outer.m[i];
    for (int j = 0; j < 4; ++j) {
      const double sum = (row[0] * inner.m[0][j] + row[1] * inner.m[1][j]) + row[2] * inner.m[2][j];
      product.m[i][j] = j == 3 ? sum + row[3] : sum;
    }
  }
  return product;
}

// True if the determinant is negative. The transform then changes clockwise triangles to
// counter-clockwise ones, and the reverse.
inline bool mirrors(const Transform& transform) {
  const auto& m = transform.m;
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
             m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
             m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]) <
         0;
}

inline void apply(const Transform& transform, const double* local, double* world) {
  for (int i = 0; i < 3; ++i) {
    const double* row = transform.m[i];
    world[i] = ((row[0] * local[0] + row[1] * local[1]) + row[2] * local[2]) + row[3];
  }
}

// Returns the transform that applies scale `s` first, then rotation `r`, then translation `t`. `r`
// is a quaternion (x, y, z, w). from_trs() does not normalize `r`, because no other reader of glTF
// does. So the length of a quantized quaternion can differ slightly from 1.
inline Transform from_trs(const std::array<double, 3>& t, const std::array<double, 4>& r,
                          const std::array<double, 3>& s) {
  const double x = r[0], y = r[1], z = r[2], w = r[3];
  const double rotation[3][3] = {
      {1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)},
      {2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)},
      {2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)}};
  Transform transform;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) transform.m[i][j] = rotation[i][j] * s[static_cast<size_t>(j)];
    transform.m[i][3] = t[static_cast<size_t>(i)];
  }
  return transform;
}

// Converts a column-major 4x4 matrix, as stored in glTF. Returns false if a number is not finite or
// the last row differs from 0 0 0 1 by more than 2^-10. The tolerance admits matrices that were
// computed in single precision, such as the inverse bind matrices of skins.
inline bool from_columns(const double* columns, Transform& out) {
  const auto near = [](double value, double wanted) {
    return value - wanted <= 1.0 / 1024 && wanted - value <= 1.0 / 1024;
  };
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) out.m[i][j] = columns[4 * j + i];
  bool finite = true;
  for (int k = 0; k < 16; ++k) finite = finite && columns[k] - columns[k] == 0;
  return finite && near(columns[3], 0) && near(columns[7], 0) && near(columns[11], 0) &&
         near(columns[15], 1);
}

inline bool is_finite(const Transform& transform) {
  bool finite = true;
  for (const auto& row : transform.m)
    for (double value : row) finite = finite && value - value == 0;
  return finite;
}

}  // namespace voxdag
