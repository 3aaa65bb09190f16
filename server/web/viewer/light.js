// The light of a picture: where the sun stands, how bright the picture is, how far occluders reach. Exposure and
// reach follow what is seen.

import {subtract} from "./vector.js";

export class Light {
  // `camera` {position, target} is the first one of the file `info`, if it has one. The sun stands over its left
  // shoulder.
  constructor({origin, edge, camera}) {
    this.exposure = 1;
    this.sky_reach = 1;
    this.haze_start = 1;
    this.readings = 0;
    const back = camera ? subtract(camera.position, camera.target) : null;
    this.outside = !camera || camera.position.some((x, i) => x < origin[i] || x > origin[i] + edge);
    this.turn = back ? Math.atan2(back[2], back[0]) + 0.9 : 0;
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
