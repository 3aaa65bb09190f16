// The light of a picture: where the sun stands, how bright the picture is, how far occluders reach. Exposure and
// reach follow what is seen.

import {subtract} from "./vector.js";

export class Light {
  // Of a file with this manifest.
  constructor({origin, edge, camera}) {
    this.exposure = 1;
    this.sky_reach = 1;
    this.haze_start = 1;
    this.readings = 0;
    this.low = origin;
    this.high = origin.map((x) => x + edge);
    this.outside = true;         // of the grid: so is the first camera
    this.turn = 0;
    if (camera) this.place_sun(camera.position, camera.target);
    else this.set_sun(0);
  }

  // Over the left shoulder of a camera, the first one.
  place_sun(position, target) {
    const back = subtract(position, target);
    this.outside = position.some((x, i) => x < this.low[i] || x > this.high[i]);
    this.turn = Math.atan2(back[2], back[0]) + 0.9;
    this.set_sun(0);
  }

  // `place` is one of 48: 16 around, at three heights.
  set_sun(place) {
    const turn = this.turn - 2 * Math.PI * (place % 16) / 16, height = 0.65 + 0.25 * Math.floor(place / 16);
    this.sun = [Math.cos(turn) * Math.cos(height), Math.sin(height), Math.sin(turn) * Math.cos(height)];
  }

  // Smoothly while the camera moves, fast when it stands.
  adjust(read, moving) {
    const share = moving ? 0.15 : 0.5;
    const toward = (from, to, known) => known ? from * (to / from) ** share : to;
    this.sky_reach = toward(this.sky_reach, Math.max(1, (this.outside ? 0.35 : 1) * read.median_t), this.readings > 0);
    this.haze_start = toward(this.haze_start, Math.max(1, read.nearest_t), this.readings > 0);
    // The exposure that the first reading measures is that of light without a reach.
    this.exposure = toward(this.exposure, read.exposure, this.readings > 1);
    this.readings++;
  }
}
