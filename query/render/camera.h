// A pinhole camera in voxel units, and a function that places a camera for a set of points.
// Immutable.
#pragma once

#include <vector>

#include "query/dag/vec.h"

namespace voxdag::query {

struct Placement {
  Vec eye;
  Vec target;
  double fov_degrees = 35;  // angle between the lower and the upper edge of the picture
};

class Camera {
 public:
  // `width` and `height` are the picture's size in pixels. Throws Error{kInvalidInput} if the eye
  // is at the target, if their distance exceeds the range of a double, or if the field of view is
  // not between 0 and 180 degrees (exclusive).
  Camera(const Placement& placement, int width, int height);

  // Returns the ray through a point of the picture, in pixels from its upper left corner.
  Ray ray(double x, double y) const;
  // Returns the width of a pixel at distance 1.
  double pixel_spread() const { return pixel_; }
  const Vec& eye() const { return eye_; }
  // Unit vectors along the axes of the picture.
  const Vec& forward() const { return forward_; }
  const Vec& right() const { return right_; }
  const Vec& up() const { return up_; }

 private:
  Vec eye_, forward_, right_, up_;
  double pixel_;
  double half_width_, half_height_;  // half of the picture's size, in pixels
};

// Returns a placement from which `points` are centered in the picture and as large as possible. The
// camera is in the direction `toward_eye` (of any length) from the points. `aspect` is the
// picture's width divided by its height. A few outliers among thousands of points can be outside
// the picture. `points` must not be empty.
Placement fit_camera(const std::vector<Vec>& points, const Vec& toward_eye, double fov_degrees,
                     double aspect);

}  // namespace voxdag::query
