#include "tests/oracle/solid/crossing.h"

namespace oracle {
namespace {

// 128 bits are enough: determinants of coordinates below 2^40 are below 2^126.
__extension__ typedef __int128 Number;

// The polynomial of[0] + of[1] e + of[2] e^2 + of[3] e^3.
struct Polynomial {
  Number of[4] = {0, 0, 0, 0};

  int sign() const {
    for (const Number x : of)
      if (x != 0) return x > 0 ? 1 : -1;
    return 0;
  }
};

Polynomial operator-(Polynomial a, Number b) {
  a.of[0] -= b;
  return a;
}
Polynomial operator*(Polynomial a, Number b) {
  for (Number& x : a.of) x *= b;
  return a;
}
Polynomial operator+(Polynomial a, const Polynomial& b) {
  for (int i = 0; i < 4; ++i) a.of[i] += b.of[i];
  return a;
}

Polynomial moved(const Point& p, int axis) {
  Polynomial out;
  out.of[0] = p[axis];
  out.of[axis + 1] = 1;
  return out;
}

// Returns the 2x2 determinant of two vectors in the projection onto the axes b and c.
Number area(const Point& from, const Point& to, const Point& other, int b, int c) {
  const Number u[2] = {to[b] - from[b], to[c] - from[c]};
  const Number w[2] = {other[b] - from[b], other[c] - from[c]};
  return u[0] * w[1] - u[1] * w[0];
}

// Projects the moved point p (crossing.h) and the edge from u to w onto the axes b and c. Returns
// on which side of the edge the point is.
int side_of_edge(const Point& u, const Point& w, const Point& p, int b, int c) {
  const Polynomial pb = moved(p, b) - u[b], pc = moved(p, c) - u[c];
  return (pc * (w[b] - u[b]) + pb * (u[c] - w[c])).sign();
}

// Returns on which side of the triangle's plane the moved point p (crossing.h) is: the sign of a
// determinant.
int side_of_plane(const Triangle& t, const Point& p) {
  Polynomial volume;
  for (int a = 0; a < 3; ++a)
    volume = volume + (moved(p, a) - t[0][a]) * area(t[0], t[1], t[2], (a + 1) % 3, (a + 2) % 3);
  return volume.sign();
}

// True if all vertices are on the same side of p along `axis`. No vertex has p's coordinate.
bool is_beside(const Triangle& t, const Point& p, int axis) {
  const bool above = t[0][axis] > p[axis];
  return (t[1][axis] > p[axis]) == above && (t[2][axis] > p[axis]) == above;
}

}  // namespace

Crossing crossing_of(const Triangle& t, const Point& p, int axis) {
  const int b = (axis + 1) % 3, c = (axis + 2) % 3;
  if (is_beside(t, p, b) || is_beside(t, p, c)) return {};
  const Number facing = area(t[0], t[1], t[2], b, c);
  const int direction = facing > 0 ? 1 : facing < 0 ? -1 : 0;
  if (direction == 0) return {};
  for (int i = 0; i < 3; ++i)
    if (side_of_edge(t[i], t[(i + 1) % 3], p, b, c) != direction) return {};
  return {true, side_of_plane(t, p) == direction, -direction};
}

int leg_crossing(const Triangle& t, const Point& p, int axis, int64_t length) {
  const Crossing first = crossing_of(t, p, axis);
  if (!first.exists || first.is_before) return 0;
  Point end = p;
  end[axis] += length;
  return crossing_of(t, end, axis).is_before ? first.sign : 0;
}

int winding_number(const Triangles& triangles, const Point& p, int axis) {
  int sum = 0;
  for (const Triangle& t : triangles) {
    const Crossing crossing = crossing_of(t, p, axis);
    if (crossing.is_before) sum += crossing.sign;
  }
  return sum;
}

}  // namespace oracle
