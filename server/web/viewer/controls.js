// Handles mouse, touch and wheel input on the canvas. One pointer orbits (or turns, when flying).
// The right button, the middle button, Shift or a second finger pan. The wheel and two fingers
// zoom. Clicks are passed to the caller.

import {add, distance, dot, scale, subtract} from "./vector.js";

const kOrbitAngle = Math.PI;  // radians per height of the canvas
const kClickMovePx = 5;
const kClickTimeMs = 600;
const kDoubleTimeMs = 350;
const kDoubleMovePx = 24;
const kWheelZoom = 0.0016;  // logarithm of the zoom factor per pixel of the wheel
const kAnchorTimeMs = 400;  // wheel events within this time zoom to the same point
const kAnchorSteps = 6;     // maximum picks after the first one, if the cursor is on the sky
const kLinePx = 20;         // pixels that one line of a wheel event counts as
const kRecentMs = 80;       // inertia starts with the mean speed in this last part of a drag

export class Controls {
  // handlers: pick(x, y) -> Promise of a position or null; onClick(x, y); onDoubleClick(x, y);
  // onChange().
  constructor(canvas, camera, motion, handlers, signal) {
    Object.assign(this, {canvas, camera, motion, handlers});
    this.pointers = new Map();
    this.recent = [];
    this.press = null;  // set while a pointer is down
    this.lastClick = null;
    this.anchor = null;  // the point to which the wheel zooms
    const listen = (name, listener, options = {}) =>
        canvas.addEventListener(name, (event) => listener.call(this, event), {signal, ...options});
    listen("pointerdown", this.handleDown);
    listen("pointermove", this.handleMove);
    listen("pointerup", this.handleUp);
    listen("pointercancel", this.handleCancel);
    listen("wheel", this.handleWheel, {passive: false});
    listen("contextmenu", (event) => event.preventDefault());
  }

  position(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }
  get size() {
    return [this.canvas.clientWidth, this.canvas.clientHeight];
  }

  handleDown(event) {
    this.canvas.focus({preventScroll: true});
    event.preventDefault();  // prevents selection, and scrolling with the middle button
    try {
      this.canvas.setPointerCapture(event.pointerId);
    } catch {
      return;  // the pointer was lifted before
    }
    const at = this.position(event);
    this.motion.stop();
    this.pointers.set(event.pointerId, at);
    this.recent = [];
    if (this.pointers.size === 1) {
      const pans = event.button !== 0 || event.shiftKey;
      this.press = {
        at,
        time: event.timeStamp,
        moved: false,
        pans,
        clicks: event.button === 0 && !event.shiftKey
      };
      if (pans) this.findPanDepth(at);
    } else if (this.press) {
      this.press.moved = true;  // two fingers are not a click
      this.findPanDepth(this.centerOfFingers().at);
    }
  }

  // Makes the grabbed point follow the pointer. Until the point's depth is known, uses the depth of
  // the target.
  async findPanDepth(at) {
    const press = this.press;
    const point = await this.handlers.pick(...at);
    if (point)
      press.depth = Math.max(dot(subtract(point, this.camera.eye), this.camera.axes().forward), 0);
  }

  handleMove(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before || !this.press) return;
    const at = this.position(event);
    const {press} = this;
    if (Math.hypot(at[0] - press.at[0], at[1] - press.at[1]) > kClickMovePx) press.moved = true;
    if (!press.moved) return;
    const old = this.pointers.size > 1 ? this.centerOfFingers() : null;
    this.pointers.set(event.pointerId, at);
    const move = [at[0] - before[0], at[1] - before[1]];
    if (old) this.moveFingers(old, this.centerOfFingers());
    else if (press.pans) this.pan(...move);
    else this.rotate(move, event.timeStamp);
    this.handlers.onChange();
  }

  centerOfFingers() {
    const [a, b] = [...this.pointers.values()];
    return {
      at: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2],
      apart: Math.max(1, Math.hypot(a[0] - b[0], a[1] - b[1]))
    };
  }

  moveFingers(old, now) {
    const {camera} = this;
    this.pan(now.at[0] - old.at[0], now.at[1] - old.at[1]);
    const toward = subtract(camera.pointAtTarget(...now.at, ...this.size), camera.eye);
    const point = add(camera.eye, scale(toward, this.panDepth() / camera.distance));
    camera.zoomAbout(point, old.apart / now.apart);
    if (this.press.depth !== undefined) this.press.depth *= old.apart / now.apart;
  }

  panDepth() {
    return this.press?.depth ?? this.camera.distance;
  }
  pan(dx, dy) {
    const by = this.camera.pixelSpread(this.size[1]) * this.panDepth();
    this.camera.move(-dx * by, dy * by, 0);
  }

  rotate([dx, dy], time) {
    const angle = kOrbitAngle / this.size[1];
    this.rotateBy(-dx * angle, dy * angle);
    this.recent = this.recent.filter((move) => time - move.time < kRecentMs);
    this.recent.push({time, yaw: -dx * angle, pitch: dy * angle});
  }
  rotateBy(yaw, pitch) {
    if (this.motion.flying) this.camera.turn(yaw * 0.6, pitch * 0.6);
    else this.camera.orbit(yaw, pitch);
  }

  handleUp(event) {
    if (!this.pointers.delete(event.pointerId) || !this.press || this.pointers.size > 0) return;
    const {press} = this;
    this.press = null;
    if (press.moved) return this.startCoasting(event.timeStamp);
    if (press.clicks && event.timeStamp - press.time < kClickTimeMs)
      this.click(press.at, event.timeStamp);
  }

  handleCancel(event) {
    this.pointers.delete(event.pointerId);
    if (this.pointers.size === 0) this.press = null;
  }

  startCoasting(time) {
    const recent = this.recent.filter((move) => time - move.time < kRecentMs);
    const sum = (name) =>
        recent.reduce((total, move) => total + move[name], 0) / (kRecentMs / 1000);
    if (recent.length > 1)
      this.motion.startCoasting([sum("yaw"), sum("pitch")], (...by) => this.rotateBy(...by));
    this.handlers.onChange();
  }

  click(at, time) {
    const last = this.lastClick;
    const isDouble = last && time - last.time < kDoubleTimeMs &&
        Math.hypot(at[0] - last.at[0], at[1] - last.at[1]) < kDoubleMovePx;
    this.lastClick = isDouble ? null : {at, time};
    if (isDouble) this.handlers.onDoubleClick(...at);
    else this.handlers.onClick(...at);
  }

  // Zooms toward the surface under the cursor. If the cursor is on the sky, zooms toward the first
  // surface on the line from the cursor to the center of the picture. If only sky is on this line,
  // zooms toward the target of the camera. A zoom toward the sky could leave the scene. So until
  // the surface is known, wheel events only add to the zoom factor.
  handleWheel(event) {
    event.preventDefault();
    const at = this.position(event);
    const pixels = event.deltaY * [1, kLinePx, this.size[1]][event.deltaMode];
    this.motion.stop();
    this.findAnchor(at, event.timeStamp);
    const factor =
        Math.exp(Math.min(Math.max(pixels, -600), 600) * kWheelZoom * (event.ctrlKey ? 4 : 1));
    this.anchor.factor *= factor;
    if (this.anchor.point) this.zoomToAnchor(this.anchor);
  }

  zoomToAnchor(anchor) {
    this.camera.moveTargetToDepthOf(anchor.point);
    this.camera.zoomAbout(anchor.point, anchor.factor);
    anchor.factor = 1;
    this.handlers.onChange();
  }

  findAnchor(at, time) {
    const old = this.anchor;
    if (old && time - old.time < kAnchorTimeMs &&
        distance([...old.at, 0], [...at, 0]) < kClickMovePx) {
      old.time = time;
      return;
    }
    const anchor = this.anchor = {at, time, point: null, factor: 1};
    this.nearestSurface(at).then((point) => {
      anchor.point = point ?? [...this.camera.target];
      if (anchor === this.anchor) this.zoomToAnchor(anchor);
    });
  }

  // Picks points of the picture from `at` to the center. Resolves to the position of the first
  // surface, or to null if no pick hits a surface.
  async nearestSurface(at) {
    const center = this.size.map((c) => c / 2);
    for (let step = 0; step <= kAnchorSteps; ++step) {
      const share = step / kAnchorSteps;
      const point = await this.handlers.pick(
          at[0] + share * (center[0] - at[0]), at[1] + share * (center[1] - at[1]));
      if (point) return point;
    }
    return null;
  }
}
