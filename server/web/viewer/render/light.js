// The light of a picture: the position of the sun, the exposure, the distance within which surfaces
// hide the sky (skyReach), the distance at which haze begins (hazeStart), and the position of the
// floor. Distances are in voxels. Exposure and the two distances adapt to the visible surfaces.

import {length, scale, subtract} from "../vector.js";

export class Light {
  // Light for a file with this manifest.
  constructor({box, resolution}) {
    this.exposure = 1;
    this.skyReach = 1;
    this.hazeStart = 1;
    this.readings = 0;
    this.low = box?.low ?? [0, 0, 0];
    this.high = box?.high ?? [resolution, resolution, resolution];
    this.outside = true;  // the first camera sees the floor
    this.turn = null;     // set by the first camera
    this.setSun(0);
  }

  // True if a camera at `eye` sees the floor below the scene, with the scene's shadow.
  seesFloor(eye) {
    return eye[1] > this.low[1] && eye.some((x, i) => x < this.low[i] || x > this.high[i]);
  }

  // Returns the uniforms of the floor for a camera at `eye`: the distance of the floor below the
  // eye (0 if it is not seen), the distance over which the shadow fades, and the center of the
  // shadow.
  floor(eye) {
    const center = this.low.map((x, i) => (x + this.high[i]) / 2);
    return {
      u_floor: [this.seesFloor(eye) ? eye[1] - this.low[1] : 0, Math.max(1, this.diagonal)],
      u_floor_center: subtract(center, eye)
    };
  }
  // Returns the distance between `eye` and the box of the scene; 0 inside the box.
  distanceOfScene(eye) {
    return length(eye.map((x, i) => Math.max(this.low[i] - x, 0, x - this.high[i])));
  }
  get diagonal() {
    return length(subtract(this.high, this.low));
  }

  // After this call, the next readings set exposure, skyReach and hazeStart to their new values in
  // one step instead of approaching these values.
  forgetReadings() {
    this.readings = 0;
  }

  // Places the sun behind and to the left of the first camera, which looks along `forward`.
  placeSun(eye, forward) {
    const back = scale(forward, -1);
    this.outside = this.seesFloor(eye);
    this.turn = Math.atan2(back[2], back[0]) + 0.9;
    this.setSun(0);
  }

  // Moves the sun to one of 48 positions: `place`, 0 to 47, selects one of 16 directions at one of
  // three heights.
  setSun(place) {
    const turn = this.turn - 2 * Math.PI * (place % 16) / 16,
          height = 0.65 + 0.25 * Math.floor(place / 16);
    this.sun =
        [Math.cos(turn) * Math.cos(height), Math.sin(height), Math.sin(turn) * Math.cos(height)];
  }

  // Moves exposure, skyReach and hazeStart toward the values of a reading: slowly while the camera
  // moves, quickly when it is still.
  adjust(read, eye, moving) {
    const share = moving ? 0.15 : 0.5;
    const toward = (from, to, known) => known ? from * (to / from) ** share : to;
    this.skyReach = toward(
        this.skyReach, Math.max(1, (this.seesFloor(eye) ? 0.35 : 1) * read.medianT),
        this.readings > 0);
    this.hazeStart = toward(this.hazeStart, Math.max(1, read.nearestT), this.readings > 0);
    // The second reading also sets the exposure directly, because the first reading measured it
    // before skyReach was known.
    this.exposure = toward(this.exposure, read.exposure, this.readings > 1);
    this.readings++;
  }
}
