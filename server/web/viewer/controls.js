// Mouse, touch and wheel on the canvas. One pointer orbits (or turns, when flying), the right button,
// the middle one, Shift or a second finger pan, the wheel and two fingers zoom. What a click means is
// up to the caller.

import {add, distance, dot, scale, subtract} from "./vector.js";

const kOrbitAngle = Math.PI;       // radians per height of the canvas
const kClickMove_px = 5;
const kClickTime_ms = 600;
const kDoubleTime_ms = 350;
const kDoubleMove_px = 24;
const kWheelZoom = 0.0016;         // per pixel of the wheel
const kAnchorTime_ms = 400;        // one turn of the wheel zooms to one point
const kLine_px = 20;
const kRecent_ms = 80;             // of a drag: its speed is that of the inertia

export class Controls {
  // handlers: pick(x, y) -> Promise of a position or null; on_click(x, y); on_double_click(x, y);
  // on_change().
  constructor(canvas, camera, motion, handlers, signal) {
    Object.assign(this, {canvas, camera, motion, handlers});
    this.pointers = new Map();
    this.recent = [];
    this.press = null;         // since the first pointer went down
    this.last_click = null;
    this.anchor = null;        // of the wheel
    const listen = (name, listener, options = {}) =>
      canvas.addEventListener(name, (event) => listener.call(this, event), {signal, ...options});
    listen("pointerdown", this.handle_down);
    listen("pointermove", this.handle_move);
    listen("pointerup", this.handle_up);
    listen("pointercancel", this.handle_cancel);
    listen("wheel", this.handle_wheel, {passive: false});
    listen("contextmenu", (event) => event.preventDefault());
  }

  position(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }
  get size() {
    return [this.canvas.clientWidth, this.canvas.clientHeight];
  }

  handle_down(event) {
    this.canvas.focus({preventScroll: true});
    event.preventDefault();  // no selection, no scrolling by the middle button
    try {
      this.canvas.setPointerCapture(event.pointerId);
    } catch {
      return;  // the pointer has been lifted already
    }
    const at = this.position(event);
    this.motion.stop();
    this.pointers.set(event.pointerId, at);
    this.recent = [];
    if (this.pointers.size === 1) {
      const pans = event.button !== 0 || event.shiftKey;
      this.press = {at, time: event.timeStamp, moved: false, pans, clicks: event.button === 0 && !event.shiftKey};
      if (pans) this.find_pan_depth(at);
    } else if (this.press) {
      this.press.moved = true;  // two fingers are no click
      this.find_pan_depth(this.center_of_fingers().at);
    }
  }

  // What was grabbed follows the pointer. Until it is known, that is the target.
  async find_pan_depth(at) {
    const press = this.press;
    const point = await this.handlers.pick(...at);
    if (point) press.depth = Math.max(dot(subtract(point, this.camera.eye), this.camera.axes().forward), 0);
  }

  handle_move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before || !this.press) return;
    const at = this.position(event);
    const {press} = this;
    if (Math.hypot(at[0] - press.at[0], at[1] - press.at[1]) > kClickMove_px) press.moved = true;
    if (!press.moved) return;
    const old = this.pointers.size > 1 ? this.center_of_fingers() : null;
    this.pointers.set(event.pointerId, at);
    const move = [at[0] - before[0], at[1] - before[1]];
    if (old) this.move_fingers(old, this.center_of_fingers());
    else if (press.pans) this.pan(...move);
    else this.rotate(move, event.timeStamp);
    this.handlers.on_change();
  }

  center_of_fingers() {
    const [a, b] = [...this.pointers.values()];
    return {at: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], apart: Math.max(1, Math.hypot(a[0] - b[0], a[1] - b[1]))};
  }

  move_fingers(old, now) {
    const {camera} = this;
    this.pan(now.at[0] - old.at[0], now.at[1] - old.at[1]);
    const toward = subtract(camera.point_at_target(...now.at, ...this.size), camera.eye);
    const point = add(camera.eye, scale(toward, this.pan_depth() / camera.distance));
    camera.zoom_about(point, old.apart / now.apart);
    if (this.press.depth !== undefined) this.press.depth *= old.apart / now.apart;
  }

  pan_depth() {
    return this.press?.depth ?? this.camera.distance;
  }
  pan(dx, dy) {
    const by = this.camera.pixel_spread(this.size[1]) * this.pan_depth();
    this.camera.move(-dx * by, dy * by, 0);
  }

  rotate([dx, dy], time) {
    const angle = kOrbitAngle / this.size[1];
    this.rotate_by(-dx * angle, dy * angle);
    this.recent = this.recent.filter((move) => time - move.time < kRecent_ms);
    this.recent.push({time, yaw: -dx * angle, pitch: dy * angle});
  }
  rotate_by(yaw, pitch) {
    if (this.motion.flying) this.camera.turn(yaw * 0.6, pitch * 0.6);
    else this.camera.orbit(yaw, pitch);
  }

  handle_up(event) {
    if (!this.pointers.delete(event.pointerId) || !this.press || this.pointers.size > 0) return;
    const {press} = this;
    this.press = null;
    if (press.moved) return this.start_coasting(event.timeStamp);
    if (press.clicks && event.timeStamp - press.time < kClickTime_ms) this.click(press.at, event.timeStamp);
  }

  handle_cancel(event) {
    this.pointers.delete(event.pointerId);
    if (this.pointers.size === 0) this.press = null;
  }

  start_coasting(time) {
    const recent = this.recent.filter((move) => time - move.time < kRecent_ms);
    const sum = (name) => recent.reduce((total, move) => total + move[name], 0) / (kRecent_ms / 1000);
    if (recent.length > 1) this.motion.start_coasting([sum("yaw"), sum("pitch")], (...by) => this.rotate_by(...by));
    this.handlers.on_change();
  }

  click(at, time) {
    const last = this.last_click;
    const is_double = last && time - last.time < kDoubleTime_ms &&
                      Math.hypot(at[0] - last.at[0], at[1] - last.at[1]) < kDoubleMove_px;
    this.last_click = is_double ? null : {at, time};
    if (is_double) this.handlers.on_double_click(...at);
    else this.handlers.on_click(...at);
  }

  // Zooms to what is under the cursor; in the sky to a point as far away as the target.
  handle_wheel(event) {
    event.preventDefault();
    const at = this.position(event);
    const pixels = event.deltaY * [1, kLine_px, this.size[1]][event.deltaMode];
    this.motion.stop();
    this.find_anchor(at, event.timeStamp);
    const factor = Math.exp(Math.min(Math.max(pixels, -600), 600) * kWheelZoom * (event.ctrlKey ? 4 : 1));
    const {camera, anchor} = this;
    if (anchor.point) camera.move_target_to_depth_of(anchor.point);
    camera.zoom_about(anchor.point ?? camera.point_at_target(...at, ...this.size), factor);
    this.handlers.on_change();
  }

  find_anchor(at, time) {
    const old = this.anchor;
    if (old && time - old.time < kAnchorTime_ms && distance([...old.at, 0], [...at, 0]) < kClickMove_px) {
      old.time = time;
      return;
    }
    const anchor = this.anchor = {at, time, point: null};
    this.handlers.pick(...at).then((point) => {
      anchor.point = point;
    });
  }
}
