// The camera in the form that the shaders need, as in query/render/camera.h. The eye is an integer
// voxel plus a fraction, so float32 is sufficient for all positions relative to the eye.

import {length, pictureAxes, pictureDirection, subtract} from "../vector.js";

const kFar = 2 ** 30;  // max magnitude of the eye's coordinates, in voxels
const kNear = 1e-4;  // max difference of views that isNear() compares, relative to the grid's edge

export class View {
  // Positions are in voxels; the vertical field of view is in degrees.
  constructor({eye, target, up = [0, 1, 0], fovDegrees}) {
    const forward = subtract(target, eye);
    if (![...eye, ...target, ...up, fovDegrees].every(Number.isFinite))
      throw new Error("A camera has a number that is not finite.");
    if (!(fovDegrees > 0 && fovDegrees < 180))
      throw new Error("The field of view must be between 0 and 180 degrees.");
    if (!(length(forward) > 0)) throw new Error("The camera must not be at its target.");
    this.eye = eye.map((x) => Math.min(Math.max(x, -kFar), kFar));
    this.target = target;
    Object.assign(this, pictureAxes(forward, up));
    this.tangent = Math.tan(fovDegrees * Math.PI / 360);
  }

  // Returns the width of a pixel at distance 1, for a picture of this height.
  pixel(height) {
    return 2 * this.tangent / height;
  }

  uniforms(width, height) {
    const cell = this.eye.map(Math.floor);
    return {
      u_eye_cell: cell,
      u_eye_part: subtract(this.eye, cell),
      u_forward: this.forward,
      u_right: this.right,
      u_up: this.up,
      u_pixel: this.pixel(height),
      u_center: [width / 2, height / 2]
    };
  }

  // Returns the unit vector through a point of the picture, given in pixels from the upper left
  // corner.
  direction(x, y, width, height) {
    const pixel = this.pixel(height);
    return pictureDirection(this, (x - width / 2) * pixel, (height / 2 - y) * pixel);
  }

  // True if the pictures of both views need almost the same cells. `edge` is the edge of the grid.
  isNear(other, edge) {
    const isClose = (name, most) =>
        this[name].every((x, i) => Math.abs(x - other[name][i]) <= most);
    return isClose("eye", kNear * edge) && isClose("forward", kNear) &&
        Math.abs(this.tangent - other.tangent) <= kNear;
  }

  equals(other) {
    return other !== null &&
        ["eye", "forward", "up"].every(
            (name) => this[name].every((x, i) => x === other[name][i])) &&
        this.tangent === other.tangent;
  }
}
