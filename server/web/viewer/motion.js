// Moves the camera over time: flights to another camera, inertia, and held keys. If the user
// prefers reduced motion, a flight ends immediately and there is no inertia.

import {between} from "./camera.js";

const kFlightS = 0.35;
const kCoastS = 0.12;    // time constant of inertia: the speed falls to 1/e in this time
const kMinCoast = 0.02;  // minimum speed of inertia in radians per second
const kMaxCoast = 3;
const kTurnRate = 1.2;  // radians per second, while an arrow key is held
const kZoomRate = 1.6;  // logarithm of the zoom factor per second, while + or - is held
const kFlyRate = 0.8;   // per second, in multiples of the distance to the visible surface
const kFast = 4;        // factor of the speed while Shift is held
// A key press immediately moves the camera as far as holding the key for this number of seconds
// does.
const kFirstStepS = 1 / 20;

export class Motion {
  // seenDistance() returns the distance of the visible surface in voxels.
  constructor(camera, seenDistance) {
    this.camera = camera;
    this.seenDistance = seenDistance;
    this.reduced = matchMedia("(prefers-reduced-motion: reduce)");
    this.keys = new Set();
    this.fast = false;
    this.flight = null;
    this.coast = null;
    this.lastMs = null;
  }

  flyTo(to) {
    this.coast = null;
    if (this.reduced.matches) {
      this.camera.set(to);
      this.flight = null;
    } else {
      this.flight = {from: this.camera.get(), to, beginMs: null};
    }
  }

  // Starts inertia after a drag. `apply(yaw, pitch)` is called with steps that become smaller.
  startCoasting(speed, apply) {
    const rate = Math.hypot(...speed);
    const limited = speed.map((s) => s * Math.min(1, kMaxCoast / rate));
    this.coast = this.reduced.matches || rate < kMinCoast ? null : {speed: limited, apply};
  }

  stop() {
    this.flight = this.coast = null;
  }

  press(key, fast) {
    this.fast = fast;
    if (this.keys.has(key)) return;
    this.keys.add(key);
    this.stop();
    this.applyKey(key, kFirstStepS);
  }
  release(key) {
    this.keys.delete(key);
  }
  releaseAll() {
    this.keys.clear();
  }

  // Advances the motion to the time `nowMs`. Returns true if the camera is still moving.
  step(nowMs) {
    const elapsedS = this.lastMs === null ? 0 : Math.min(0.1, (nowMs - this.lastMs) / 1000);
    for (const key of this.keys) this.applyKey(key, elapsedS);
    if (this.coast) this.stepCoast(elapsedS);
    if (this.flight) this.stepFlight(nowMs);
    const moving = this.keys.size > 0 || this.coast !== null || this.flight !== null;
    this.lastMs = moving ? nowMs : null;
    return moving;
  }

  stepCoast(elapsedS) {
    const {speed, apply} = this.coast;
    apply(speed[0] * elapsedS, speed[1] * elapsedS);
    this.coast.speed = speed.map((s) => s * Math.exp(-elapsedS / kCoastS));
    if (Math.hypot(...this.coast.speed) < kMinCoast) this.coast = null;
  }

  stepFlight(nowMs) {
    const flight = this.flight;
    flight.beginMs ??= nowMs;
    const share = Math.min(1, (nowMs - flight.beginMs) / 1000 / kFlightS);
    this.camera.set(between(flight.from, flight.to, share * share * (3 - 2 * share)));
    if (share >= 1) this.flight = null;
  }

  applyKey(key, elapsedS) {
    const camera = this.camera;
    const angle = kTurnRate * elapsedS * (this.fast ? 2 : 1);
    const step = kFlyRate * elapsedS * this.seenDistance() * (this.fast ? kFast : 1);
    const turn = this.flying ? (yaw, pitch) => camera.turn(yaw, pitch) :
                               (yaw, pitch) => camera.orbit(yaw, pitch);
    const actions = {
      left: () => turn(-angle, 0),
      right: () => turn(angle, 0),
      up: () => turn(0, angle),
      down: () => turn(0, -angle),
      forward: () => camera.move(0, 0, step),
      back: () => camera.move(0, 0, -step),
      strafeLeft: () => camera.move(-step, 0, 0),
      strafeRight: () => camera.move(step, 0, 0),
      rise: () => camera.move(0, step, 0),
      sink: () => camera.move(0, -step, 0),
      zoomIn: () => camera.zoomAbout(camera.target, Math.exp(-kZoomRate * elapsedS)),
      zoomOut: () => camera.zoomAbout(camera.target, Math.exp(kZoomRate * elapsedS)),
    };
    actions[key]();
  }
}
