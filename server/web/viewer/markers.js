// Marks on the picture, at the picked voxel and at the first point of a measurement.

import {h} from "../lib/dom.js";

import {dot, subtract} from "./vector.js";

export class Markers {
  constructor(stage) {
    this.marks = ["picked", "start"].map(
        (kind) => h("span", {class: `mark ${kind}`, "aria-hidden": "true", hidden: true}));
    stage.append(...this.marks);
  }

  dispose() {
    for (const mark of this.marks) mark.remove();
  }

  // `positions`: the picked point and the first point of the measurement, both in voxels. A point
  // that does not exist is null or undefined.
  show(positions, camera, width, height) {
    const {forward, right, up} = camera.axes();
    const pixel = camera.pixelSpread(height);
    this.marks.forEach((mark, i) => {
      const offset = positions[i] ? subtract(positions[i], camera.eye) : null;
      const depth = offset ? dot(offset, forward) : 0;
      mark.hidden = !(depth > 0);
      if (mark.hidden) return;
      const x = width / 2 + dot(offset, right) / depth / pixel,
            y = height / 2 - dot(offset, up) / depth / pixel;
      mark.hidden = !(x >= 0 && x <= width && y >= 0 && y <= height);
      mark.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    });
  }
}
