// Projects points and lines of the grid to the picture of a camera.

import {dot, subtract} from "./vector.js";

export class Projection {
  // `width` and `height` are the size of the picture. Lines nearer to the eye than `near` voxels
  // are cut off.
  constructor(camera, width, height, near = 1e-6) {
    Object.assign(this, camera.axes(), {eye: camera.eye, width, height, near});
    this.pixel = camera.pixelSpread(height);
  }

  // Returns [x, y], from the upper left corner of the picture; null for a point behind the eye.
  point(position) {
    const place = this.place(position);
    return place[2] >= this.near ? this.toPixels(place) : null;
  }

  // Returns the ends [x, y] of a line's part in front of the eye; null if there is no such part.
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
