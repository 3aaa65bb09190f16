// The occupied subvolumes as cubes in an isometric view. Pending cubes are translucent. Built cubes
// are solid, and are highlighted for a moment when they are finished.

import {getJson} from "../lib/api.js";
import {h, setText} from "../lib/dom.js";
import {countText, hasEnded} from "../lib/format.js";

const kWidth = 480, kHeight = 460;
const kMargin = 10;
const kCos = Math.cos(Math.PI / 6), kSin = 0.5;
const kGlowMs = 900;          // duration of the highlight of a new cube
const kMinOutlinePx = 5;      // smaller cubes are drawn without outlines
const kMaxGlowing = 6000;     // with more cubes nothing glows, because each frame draws all cubes
const kMinIntervalMs = 1000;  // between two requests

export class CubesView {
  constructor(path, signal) {
    this.path = path;
    this.signal = signal;
    this.cubes = [];
    this.turn = 0;  // quarter turns about the vertical axis
    this.nextFetchMs = 0;
    this.canvas = h("canvas", {class: "cubes", role: "img"});
    this.note = h("p", {class: "faint"});
    this.turner = h(
        "div", {class: "buttons"},
        ...[[-1, "Turn left"], [1, "Turn right"]].map(
            ([by, text]) => h(
                "button",
                {type: "button", class: "quiet small", on: {click: () => this.turnBy(by)}}, text)));
    this.element =
        h("div", {class: "cubes-view"}, this.canvas,
          h("div", {class: "split"}, this.note, this.turner));
    this.count = undefined;  // the text about the built subvolumes
    this.attributesText = "";
    this.setEmpty(true);
    this.sayWhyEmpty(false, false);
    const scheme = matchMedia("(prefers-color-scheme: dark)");
    scheme.addEventListener("change", () => this.draw(), {signal});
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  // Fetches the cubes, at a limited rate, if the job has built more of them.
  async update(job) {
    const {built, total} = job.progress?.subvolumes ?? {total: 0};
    const key = `${job.attempts} ${built} ${total} ${hasEnded(job.state)}`;
    const sayIfEmpty = () => {
      if (!this.cubes.length) this.sayWhyEmpty(hasEnded(job.state), !total || key === this.key);
    };
    sayIfEmpty();
    this.attributesText = attributesText(job);
    this.showNote();
    if (!total || key === this.key || this.fetching) return;
    const waitMs = this.nextFetchMs - performance.now();
    if (waitMs > 0) {
      this.timer ??= setTimeout(() => {
        this.timer = null;
        this.update(job);
      }, waitMs);
      return;
    }
    this.fetching = true;
    const begin = performance.now();
    try {
      this.show(await getJson(this.path, this.signal));
      this.key = key;
    } catch (problem) {
      if (this.signal.aborted) return;
      if (problem.status === 404)
        this.key = key;  // 404: not planned yet, or the job failed before planning
    } finally {
      this.fetching = false;
      sayIfEmpty();
      const now = performance.now();
      this.nextFetchMs = now + Math.max(kMinIntervalMs, 10 * (now - begin));
    }
  }

  show({resolution, cubes, built, total}) {
    const before = new Map(this.cubes.map((cube) => [cube.key, cube]));
    const now = performance.now();
    this.resolution = resolution;
    this.cubes = cubes.map(([x, y, z, edge, isBuilt]) => {
      const key = `${x} ${y} ${z} ${edge}`;
      const old = before.get(key);
      const litAt = !isBuilt ? null : !old ? -Infinity : old.litAt ?? now;
      return {key, x, y, z, edge, litAt, faces: {}};
    });
    this.setEmpty(this.cubes.length === 0);
    this.order();
    this.draw();
    this.count = `${countText(built)} of ${countText(total)} occupied subvolumes are built`;
    this.showNote();
  }

  // Shows how many subvolumes are built and, once they are, the progress of their attributes.
  showNote() {
    if (this.count === undefined) return;
    setText(this.note, this.count + this.attributesText);
    this.canvas.setAttribute("aria-label", this.count + this.attributesText);
  }

  setEmpty(empty) {
    this.canvas.hidden = this.turner.hidden = empty;
  }

  // Shows why there are no cubes. `ended`: the job has ended, so it gets cubes only if it is
  // retried. `known`: the service has reported that the job has no cubes.
  sayWhyEmpty(ended, known) {
    if (this.resolution !== undefined) return;
    const end = known ? "There are no subvolumes." : "";
    setText(this.note, ended ? end : "Shown when the subvolumes are planned.");
  }

  turnBy(by) {
    this.turn = (this.turn + by + 4) % 4;
    this.order();
    this.draw();
  }

  // Returns the low corner of a cube after the rotation of the view; y is up.
  turned({x, y, z, edge}) {
    const far = (c) => this.resolution - edge - c;
    return [[x, y, z], [z, y, far(x)], [far(x), y, far(z)], [far(z), y, x]][this.turn];
  }

  // Sorts the cubes from back to front. Octree cubes do not overlap, so for any mixture of sizes
  // the Morton order of their low corners is correct: a cube that is lower than another cube on all
  // axes always comes first.
  order() {
    const minEdge = Math.min(...this.cubes.map((cube) => cube.edge));
    for (const cube of this.cubes) {
      cube.at = this.turned(cube);
      cube.rank = morton(...cube.at.map((c) => Math.floor(c / minEdge)));
    }
    this.cubes.sort((a, b) => a.rank - b.rank);
    // A face that touches another cube of the same size is hidden.
    const here = new Set(this.cubes.map((cube) => `${cube.at} ${cube.edge}`));
    for (const {at: [x, y, z], edge, faces} of this.cubes) {
      faces.top = !here.has(`${[x, y + edge, z]} ${edge}`);
      faces.left = !here.has(`${[x, y, z + edge]} ${edge}`);
      faces.right = !here.has(`${[x + edge, y, z]} ${edge}`);
    }
  }

  draw() {
    if (!this.cubes.length || !this.canvas.clientWidth) return;
    const ratio = window.devicePixelRatio || 1;
    const scale = this.canvas.clientWidth / kWidth * ratio;
    this.canvas.width = Math.round(kWidth * scale);
    this.canvas.height = Math.round(kHeight * scale);
    const pen = this.canvas.getContext("2d");
    pen.scale(scale, scale);
    pen.lineJoin = "round";
    const colors = this.colors();
    const size = (kHeight - 2 * kMargin) / 2 / this.resolution;  // pixels per voxel
    this.frame(pen, colors, size);
    for (const cube of this.cubes)
      if (cube.litAt === null) this.drawPending(pen, colors, size, cube);
    const glows =
        this.cubes.length <= kMaxGlowing && !matchMedia("(prefers-reduced-motion: reduce)").matches;
    const now = performance.now();
    let glowing = false;
    for (const cube of this.cubes) {
      if (cube.litAt === null) continue;
      const glow = glows ? Math.max(0, 1 - (now - cube.litAt) / kGlowMs) : 0;
      glowing ||= glow > 0;
      this.drawBuilt(pen, colors, size, cube, glow);
    }
    if (glowing && !this.signal.aborted) requestAnimationFrame(() => this.draw());
  }

  colors() {
    const style = getComputedStyle(this.canvas);
    const get = (name) => style.getPropertyValue(name).trim();
    return {
      top: get("--cube-top"),
      left: get("--cube-left"),
      right: get("--cube-right"),
      edge: get("--cube-edge"),
      wait: get("--cube-wait"),
      waitEdge: get("--cube-wait-edge"),
      frame: get("--line"),
      glow: get("--cube-glow")
    };
  }

  point(size, x, y, z) {
    return [
      kWidth / 2 + (x - z) * kCos * size, kMargin + (this.resolution + (x + z) * kSin - y) * size
    ];
  }

  // Draws the floor and the far edges of the grid.
  frame(pen, colors, size) {
    const r = this.resolution;
    const lines = [
      [[0, 0, 0], [r, 0, 0], [r, 0, r], [0, 0, r], [0, 0, 0]], [[0, 0, 0], [0, r, 0]],
      [[0, r, r], [0, r, 0], [r, r, 0]], [[0, 0, r], [0, r, r]], [[r, 0, 0], [r, r, 0]]
    ];
    pen.strokeStyle = colors.frame;
    pen.lineWidth = 1;
    for (const line of lines) {
      pen.beginPath();
      line.forEach(([x, y, z]) => pen.lineTo(...this.point(size, x, y, z)));
      pen.stroke();
    }
  }

  // Calls paint(face) for each visible face, after setting the face's path.
  eachFace(pen, size, {at: [x, y, z], edge}, paint) {
    const p = (dx, dy, dz) => this.point(size, x + dx * edge, y + dy * edge, z + dz * edge);
    const paths = {
      top: [p(0, 1, 0), p(1, 1, 0), p(1, 1, 1), p(0, 1, 1)],
      left: [p(0, 0, 1), p(1, 0, 1), p(1, 1, 1), p(0, 1, 1)],
      right: [p(1, 0, 0), p(1, 0, 1), p(1, 1, 1), p(1, 1, 0)],
    };
    for (const [face, points] of Object.entries(paths)) {
      pen.beginPath();
      points.forEach((point) => pen.lineTo(...point));
      pen.closePath();
      paint(face);
    }
  }

  drawPending(pen, colors, size, cube) {
    const outlined = cube.edge * size >= kMinOutlinePx;
    pen.lineWidth = 0.75;
    pen.strokeStyle = colors.waitEdge;
    pen.fillStyle = colors.wait;
    this.eachFace(pen, size, cube, (face) => {
      if (!cube.faces[face]) return;
      pen.fill();
      if (outlined) pen.stroke();
    });
  }

  drawBuilt(pen, colors, size, cube, glow) {
    pen.lineWidth = 0.75;
    pen.strokeStyle = colors.edge;
    this.eachFace(pen, size, cube, (face) => {
      pen.fillStyle = colors[face];
      pen.fill();
      if (glow > 0) {
        pen.globalAlpha = glow;
        pen.fillStyle = colors.glow;
        pen.fill();
        pen.globalAlpha = 1;
      }
      if (cube.edge * size >= kMinOutlinePx) pen.stroke();
    });
  }
}

// Returns the progress of the stage that makes the colors and other attributes of a running job; ""
// in all other stages.
function attributesText({state, progress}) {
  if (state !== "running" || progress?.stage !== "color" || !progress.total) return "";
  const percent = Math.floor(100 * progress.done / progress.total);
  return `. Attributes: ${percent} % of the regions are ready`;
}

// Returns the Morton code of a position. A coordinate has up to 17 bits, so a double represents the
// 51 bits of the code exactly.
function morton(x, y, z) {
  let code = 0;
  for (let bit = 2 ** 16; bit >= 1; bit /= 2) {
    code = code * 8 + (x & bit ? 4 : 0) + (y & bit ? 2 : 0) + (z & bit ? 1 : 0);
  }
  return code;
}
