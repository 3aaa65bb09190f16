#include "query/render/camera.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/base/error.h"
#include "core/base/text.h"
#include "query/render/sampling.h"

namespace voxdag::query {
namespace {

constexpr double kMargin = 1.06;  // enlarges the picture to leave free space around the points

double half_tangent(double fov_degrees) { return std::tan(fov_degrees * kPi / 360); }

// Computes the directions `right` and `up` of the picture, for a camera that looks along `forward`.
// If the camera looks straight down, up is -z.
void picture_axes(const Vec& forward, Vec& right, Vec& up) {
  const bool vertical = std::fabs(forward[1]) > 1 - 1e-9;
  const Vec reference = vertical ? Vec{{0, 0, forward[1] < 0 ? -1.0 : 1.0}} : Vec{{0, 1, 0}};
  right = normalized(cross(forward, reference));
  up = cross(right, forward);
}

// Returns the largest coordinate of the points along `axis`. If the outermost 1/2000 of the points
// account for more than a tenth of the extent, they are ignored as outliers.
double bound(const std::vector<Vec>& points, const Vec& axis) {
  std::vector<double> along;
  for (const Vec& p : points) along.push_back(dot(p, axis));
  std::sort(along.begin(), along.end());
  const double last = along.back(), inner = along[along.size() - 1 - along.size() / 2000];
  return last - inner > 0.1 * (last - along.front()) ? inner : last;
}

std::string point_text(const Vec& p) {
  return number_text(p[0]) + " " + number_text(p[1]) + " " + number_text(p[2]);
}

}  // namespace

Camera::Camera(const Placement& p, int width, int height)
    : eye_(p.eye), half_width_(width / 2.0), half_height_(height / 2.0) {
  if (!(p.fov_degrees > 0 && p.fov_degrees < 180))
    throw Error(ErrorCode::kInvalidInput, "the field of view is " + std::to_string(p.fov_degrees) +
                                              " degrees: expected more than 0 and less than 180");
  const double distance = length(p.target - p.eye);
  if (!(distance > 0))
    throw Error(ErrorCode::kInvalidInput,
                "the camera and its target are the same point: expected two different points");
  if (!std::isfinite(distance))
    throw Error(ErrorCode::kInvalidInput, "the distance from the camera at " + point_text(p.eye) +
                                              " to its target at " + point_text(p.target) +
                                              " is not finite: expected coordinates below 1e150");
  forward_ = normalized(p.target - p.eye);
  picture_axes(forward_, right_, up_);
  pixel_ = half_tangent(p.fov_degrees) / half_height_;
}

Ray Camera::ray(double x, double y) const {
  const Vec offset = right_ * ((x - half_width_) * pixel_) + up_ * ((half_height_ - y) * pixel_);
  return {eye_, normalized(forward_ + offset)};
}

Placement fit_camera(const std::vector<Vec>& points, const Vec& toward_eye, double fov_degrees,
                     double aspect) {
  const Vec back = normalized(toward_eye);
  Vec right, up;
  picture_axes(back * -1.0, right, up);
  const double tangent_up = half_tangent(fov_degrees) / kMargin;
  // Below, p.right is the coordinate of p along the axis `right`, and likewise for `up` and `back`.
  // For an eye at e, the point p is in the picture if |p.right - e.right| <= tangent * (e.back -
  // p.back), and if the same is true with `up` instead of `right`. Each of the two inequalities
  // gives two linear bounds on e, and e is placed midway between the tightest bounds.
  double e[2] = {0, 0}, distance = bound(points, back) + 1;
  const Vec axes[2] = {right, up};
  const double tangents[2] = {tangent_up * aspect, tangent_up};
  for (int i = 0; i < 2; ++i) {
    const double high = bound(points, axes[i] + back * tangents[i]);
    const double low = bound(points, back * tangents[i] - axes[i]);
    e[i] = (high - low) / 2;
    distance = std::max(distance, (high + low) / (2 * tangents[i]));
  }
  double middle = 0;
  for (const Vec& p : points) middle += dot(p, back) / static_cast<double>(points.size());
  const Vec axis = right * e[0] + up * e[1];
  return {axis + back * distance, axis + back * middle, fov_degrees};
}

}  // namespace voxdag::query
