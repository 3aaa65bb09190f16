// Projects points and lines of the grid to a picture.

import {dot, subtract} from "./vector.js";

export class Projection {
  // `width` and `height` are the size of the picture in pixels. Parts of lines that are less than
  // `near` voxels in front of the eye are cut off.
  constructor(camera, width, height, near = 1e-6) {
    Object.assign(this, camera.axes(), {eye: camera.eye, width, height, near});
    this.pixel = camera.pixelSpread(height);
  }

  // Returns the pixel [x, y] at which a point is visible, from the upper left corner of the
  // picture; null if the point is behind the eye.
  point(position) {
    const place = this.place(position);
    return place[2] >= this.near ? this.toPixels(place) : null;
  }

  // Returns the two ends [x, y] of the part of a line that is in front of the eye; null if there is
  // no such part.
  line(from, to) {
    let a = this.place(from), b = this.place(to);
    if (a[2] < this.near && b[2] < this.near) return null;
    if (a[2] < this.near) a = this.cut(a, b);
    if (b[2] < this.near) b = this.cut(b, a);
    return [this.toPixels(a), this.toPixels(b)];
  }

  place(position) {
    const offset = subtract(position, this.eye);
    return [dot(offset, this.right), dot(offset, this.up), dot(offset, this.forward)];
  }
  cut(from, to) {
    const share = (this.near - from[2]) / (to[2] - from[2]);
    return from.map((c, i) => c + share * (to[i] - c));
  }
  toPixels([x, y, depth]) {
    return [this.width / 2 + x / depth / this.pixel, this.height / 2 - y / depth / this.pixel];
  }
}
