// A pinhole camera in voxel units, computed in doubles. It gives the same picture as
// query/render/camera.h.
//
// Invariants: the eye is not on the target. After a motion, the direction of view is at most
// kMaxPitch above or below the horizontal, so the camera never turns over. Only set() can make it
// look straight up or down.

import {
  add,
  distance,
  dot,
  length,
  mix,
  pictureAxes,
  pictureDirection,
  scale,
  subtract
} from "./vector.js";

const kMaxPitch = 89.9 * Math.PI / 180;
const kMinDistance = 1 / 64;  // minimum distance from the eye to the target, in voxels
const kFarthest = 32;  // max distance of the eye from the grid's center, in edges of the grid

export class Camera {
  constructor(resolution) {
    this.resolution = resolution;
    this.set({
      eye: [0.5, 0.6, 2.5].map((c) => c * resolution),
      target: Array(3).fill(resolution / 2),
      fovDegrees: 35
    });
  }

  // Sets the camera. Throws an Error, with a message for users, if no picture can be taken from
  // this position.
  set({eye, target, fovDegrees}) {
    if (![...eye, ...target].every(Number.isFinite))
      throw new Error("The coordinates of the camera and its target must be finite numbers.");
    if (!(fovDegrees >= 1 && fovDegrees <= 170))
      throw new Error("The field of view must be between 1 and 170 degrees.");
    if (!(distance(eye, target) > 0)) throw new Error("The camera must not be at its target.");
    Object.assign(this, {eye: [...eye], target: [...target], fovDegrees});
  }
  get() {
    return {eye: [...this.eye], target: [...this.target], fovDegrees: this.fovDegrees};
  }

  get distance() {
    return distance(this.eye, this.target);
  }

  // Returns the axes of the picture, {forward, right, up}. If the camera looks straight down, the
  // up axis is -z.
  axes() {
    return pictureAxes(subtract(this.target, this.eye));
  }

  // Returns the width of a pixel at distance 1 in a picture of this height.
  pixelSpread(height) {
    return Math.tan(this.fovDegrees * Math.PI / 360) / (height / 2);
  }

  // Returns the unit direction of the ray through a point of the picture. x and y are in pixels
  // from the upper left corner.
  direction(x, y, width, height) {
    const pixel = this.pixelSpread(height);
    return pictureDirection(this.axes(), (x - width / 2) * pixel, (height / 2 - y) * pixel);
  }

  // Rotates the eye around the target. Positive angles (radians) move the eye to the right and up.
  orbit(yaw, pitch) {
    const at = spherical(subtract(this.eye, this.target));
    this.eye =
        add(this.target,
            fromSpherical({...at, yaw: at.yaw + yaw, pitch: limitPitch(at.pitch + pitch)}));
  }

  // Rotates the view around the eye. Positive angles (radians) turn it to the right and up.
  turn(yaw, pitch) {
    const at = spherical(subtract(this.eye, this.target));
    this.target = subtract(
        this.eye, fromSpherical({...at, yaw: at.yaw - yaw, pitch: limitPitch(at.pitch - pitch)}));
  }

  // Moves both eye and target. The distances, in voxels, are along the axes of the picture.
  move(toRight, toTop, forward) {
    const axes = this.axes();
    this.moveBy(
        add(add(scale(axes.right, toRight), scale(axes.up, toTop)), scale(axes.forward, forward)));
  }
  moveBy(offset) {
    const eye = add(this.eye, offset);
    const limit = kFarthest * this.resolution;
    const center = Array(3).fill(this.resolution / 2);
    if (distance(eye, center) > limit && distance(eye, center) > distance(this.eye, center)) return;
    this.target = add(this.target, offset);
    this.eye = eye;
  }

  // Multiplies the distances of eye and target from `point` by `factor`, limited so that
  // kMinDistance and kFarthest hold. The point keeps its place in the picture.
  zoomAbout(point, factor) {
    const least =
        kMinDistance / Math.min(this.distance, Math.max(distance(this.eye, point), kMinDistance));
    const far = Math.max(
        1, kFarthest * this.resolution / Math.max(this.distance, distance(this.eye, point)));
    const by = Math.min(Math.max(factor, Math.min(1, least)), far);
    const eye = add(point, scale(subtract(this.eye, point), by));
    const target = add(point, scale(subtract(this.target, point), by));
    if (distance(eye, target) > 0) Object.assign(this, {eye, target});
  }

  // Moves the target to the depth of `point`, so that the camera orbits the visible surface. The
  // picture does not change.
  moveTargetToDepthOf(point) {
    const {forward} = this.axes();
    const depth = dot(subtract(point, this.eye), forward);
    if (depth > kMinDistance) this.target = add(this.eye, scale(forward, depth));
  }

  // Returns the point at the depth of the target on the ray through a pixel.
  pointAtTarget(x, y, width, height) {
    const direction = this.direction(x, y, width, height);
    return add(this.eye, scale(direction, this.distance / dot(direction, this.axes().forward)));
  }
}

// Returns the camera at the fraction `share` of the way between two cameras, along the shorter arc.
export function between(from, to, share) {
  if (share >= 1) return to;
  const a = spherical(subtract(from.eye, from.target)), b = spherical(subtract(to.eye, to.target));
  const arc = Math.atan2(Math.sin(b.yaw - a.yaw), Math.cos(b.yaw - a.yaw));
  const target = mix(from.target, to.target, share);
  const offset = fromSpherical({
    radius: Math.exp(Math.log(a.radius) * (1 - share) + Math.log(b.radius) * share),
    yaw: a.yaw + arc * share,
    pitch: a.pitch + (b.pitch - a.pitch) * share,
  });
  return {
    eye: add(target, offset),
    target,
    fovDegrees: from.fovDegrees + (to.fovDegrees - from.fovDegrees) * share
  };
}

function spherical(offset) {
  const [x, y, z] = offset;
  const radius = length(offset);
  const level = Math.hypot(x, z);
  return {radius, yaw: level > 1e-9 * radius ? Math.atan2(x, z) : 0, pitch: Math.atan2(y, level)};
}

function fromSpherical({radius, yaw, pitch}) {
  const level = radius * Math.cos(pitch);
  return [level * Math.sin(yaw), radius * Math.sin(pitch), level * Math.cos(yaw)];
}

const limitPitch = (pitch) => Math.min(Math.max(pitch, -kMaxPitch), kMaxPitch);
