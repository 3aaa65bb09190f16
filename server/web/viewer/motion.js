// What moves the camera over time: flights to another camera, inertia, keys that are down. With
// reduced motion a flight arrives at once and nothing coasts.

import {between} from "./camera.js";

const kFlight_s = 0.35;
const kCoast_s = 0.12;         // inertia falls to 1/e in this time
const kMinCoast = 0.02;        // radians per second
const kMaxCoast = 3;
const kTurnRate = 1.2;         // radians per second, by arrow keys
const kZoomRate = 1.6;         // per second, by + and -
const kFlyRate = 0.8;          // distances of what is seen, per second
const kFast = 4;
const kFirstStep_s = 1 / 20;   // of a key, however short it is pressed

export class Motion {
  // seen_distance() is in voxels.
  constructor(camera, seen_distance) {
    this.camera = camera;
    this.seen_distance = seen_distance;
    this.reduced = matchMedia("(prefers-reduced-motion: reduce)");
    this.keys = new Set();
    this.fast = false;
    this.flight = null;
    this.coast = null;
    this.last_ms = null;
  }

  fly_to(to) {
    this.coast = null;
    if (this.reduced.matches) {
      this.camera.set(to);
      this.flight = null;
    } else {
      this.flight = {from: this.camera.get(), to, begin_ms: null};
    }
  }

  // Inertia after a drag: `apply(yaw, pitch)` is called with what is left of the speed.
  start_coasting(speed, apply) {
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
    this.apply_key(key, kFirstStep_s);
  }
  release(key) {
    this.keys.delete(key);
  }
  release_all() {
    this.keys.clear();
  }

  // Advances to the time; returns whether the camera still moves.
  step(now_ms) {
    const elapsed_s = this.last_ms === null ? 0 : Math.min(0.1, (now_ms - this.last_ms) / 1000);
    for (const key of this.keys) this.apply_key(key, elapsed_s);
    if (this.coast) this.step_coast(elapsed_s);
    if (this.flight) this.step_flight(now_ms);
    const moving = this.keys.size > 0 || this.coast !== null || this.flight !== null;
    this.last_ms = moving ? now_ms : null;
    return moving;
  }

  step_coast(elapsed_s) {
    const {speed, apply} = this.coast;
    apply(speed[0] * elapsed_s, speed[1] * elapsed_s);
    this.coast.speed = speed.map((s) => s * Math.exp(-elapsed_s / kCoast_s));
    if (Math.hypot(...this.coast.speed) < kMinCoast) this.coast = null;
  }

  step_flight(now_ms) {
    const flight = this.flight;
    flight.begin_ms ??= now_ms;
    const share = Math.min(1, (now_ms - flight.begin_ms) / 1000 / kFlight_s);
    this.camera.set(between(flight.from, flight.to, share * share * (3 - 2 * share)));
    if (share >= 1) this.flight = null;
  }

  apply_key(key, elapsed_s) {
    const camera = this.camera;
    const angle = kTurnRate * elapsed_s * (this.fast ? 2 : 1);
    const step = kFlyRate * elapsed_s * this.seen_distance() * (this.fast ? kFast : 1);
    const turn = this.flying ? (yaw, pitch) => camera.turn(yaw, pitch) : (yaw, pitch) => camera.orbit(yaw, pitch);
    const actions = {
      left: () => turn(-angle, 0), right: () => turn(angle, 0), up: () => turn(0, angle), down: () => turn(0, -angle),
      forward: () => camera.move(0, 0, step), back: () => camera.move(0, 0, -step),
      strafe_left: () => camera.move(-step, 0, 0), strafe_right: () => camera.move(step, 0, 0),
      rise: () => camera.move(0, step, 0), sink: () => camera.move(0, -step, 0),
      zoom_in: () => camera.zoom_about(camera.target, Math.exp(-kZoomRate * elapsed_s)),
      zoom_out: () => camera.zoom_about(camera.target, Math.exp(kZoomRate * elapsed_s)),
    };
    actions[key]();
  }
}
