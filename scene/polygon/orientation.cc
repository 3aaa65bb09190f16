#include "scene/polygon/orientation.h"

#include <cmath>

namespace voxdag::polygon {
namespace {

int sign_of(double value) { return (value > 0) - (value < 0); }

// An exact sum of doubles, stored as components that do not overlap, in increasing order of
// magnitude (Shewchuk 1997, "Adaptive Precision Floating-Point Arithmetic", Grow-Expansion).
class ExactSum {
 public:
  void add_product(double a, double b) {
    const double product = a * b;
    add(std::fma(a, b, -product));
    add(product);
  }
  // Returns the sign of the sum, which is the sign of the last nonzero component.
  int sign() const {
    for (int i = size_ - 1; i >= 0; --i)
      if (components_[i] != 0) return sign_of(components_[i]);
    return 0;
  }

 private:
  void add(double value) {
    for (int i = 0; i < size_; ++i) {
      const double sum = value + components_[i], part = sum - value;
      components_[i] = (value - (sum - part)) + (components_[i] - part);
      value = sum;
    }
    components_[size_++] = value;
  }

  double components_[12];
  int size_ = 0;
};

}  // namespace

int orientation(const Point& a, const Point& b, const Point& c) {
  const double left = (a.x - c.x) * (b.y - c.y), right = (a.y - c.y) * (b.x - c.x);
  const double determinant = left - right;
  // Bound on the rounding error: (3 + 16 u) u times the sum of the magnitudes, with u = 2^-53.
  const double bound = 3.3306690738754716e-16 * (std::fabs(left) + std::fabs(right));
  if (determinant > bound || -determinant > bound) return sign_of(determinant);
  ExactSum sum;
  sum.add_product(a.x, b.y);
  sum.add_product(-a.y, b.x);
  sum.add_product(b.x, c.y);
  sum.add_product(-b.y, c.x);
  sum.add_product(c.x, a.y);
  sum.add_product(-c.y, a.x);
  return sum.sign();
}

}  // namespace voxdag::polygon
