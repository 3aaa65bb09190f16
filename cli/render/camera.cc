#include "cli/render/camera.h"

#include <algorithm>

#include "core/base/error.h"

namespace voxdag::render {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kMargin = 1.04;

double half_tangent(double fov_degrees) { return std::tan(fov_degrees * kPi / 360); }

// Right and up of a camera that looks along `forward`; looking straight down, up is -z.
void picture_axes(const Vec& forward, Vec& right, Vec& up) {
  const bool vertical = std::fabs(forward[1]) > 1 - 1e-9;
  const Vec reference = vertical ? Vec{{0, 0, forward[1] < 0 ? -1.0 : 1.0}} : Vec{{0, 1, 0}};
  right = normalized(cross(forward, reference));
  up = cross(right, forward);
}

}  // namespace

Camera::Camera(const Placement& p, int width, int height)
    : eye_(p.eye), half_width_(width / 2.0), half_height_(height / 2.0) {
  if (!(p.fov_degrees > 0 && p.fov_degrees < 180))
    throw Error(ErrorCode::kInvalidInput, "the field of view must lie between 0 and 180 degrees");
  if (!(length(p.target - p.eye) > 0))
    throw Error(ErrorCode::kInvalidInput, "the camera stands on its target");
  forward_ = normalized(p.target - p.eye);
  picture_axes(forward_, right_, up_);
  pixel_ = half_tangent(p.fov_degrees) / half_height_;
}

Ray Camera::ray(double x, double y) const {
  const Vec offset = right_ * ((x - half_width_) * pixel_) + up_ * ((half_height_ - y) * pixel_);
  return {eye_, normalized(forward_ + offset)};
}

Placement whole_box(const Box& box, const Vec& towards_eye, double fov_degrees, double aspect) {
  const Vec back = normalized(towards_eye);
  Vec right, up;
  picture_axes(back * -1.0, right, up);
  const double tangent = half_tangent(fov_degrees);
  // A corner is seen if it lies no farther from the axis than the view is wide at its depth.
  double distance = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec p = Vec{{corner & 4 ? box.high[0] : box.low[0], corner & 2 ? box.high[1] : box.low[1],
                       corner & 1 ? box.high[2] : box.low[2]}} -
                  box.centre();
    const double across = std::max(std::fabs(dot(p, right)) / aspect, std::fabs(dot(p, up)));
    distance = std::max(distance, dot(p, back) + across * kMargin / tangent);
  }
  return {box.centre() + back * distance, box.centre(), fov_degrees};
}

}  // namespace voxdag::render
