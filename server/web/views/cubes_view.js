// The occupied subvolumes as cubes in an isometric view. Pending cubes are translucent; built ones are
// solid, and highlighted for a moment when they are finished.

import {get_json} from "../lib/api.js";
import {h, set_text} from "../lib/dom.js";
import {count_text, has_ended} from "../lib/format.js";

const kWidth = 480, kHeight = 460;
const kMargin = 10;
const kCos = Math.cos(Math.PI / 6), kSin = 0.5;
const kGlow_ms = 900;
const kMinOutline_px = 5;      // smaller cubes are drawn without outlines
const kMaxGlowing = 6000;      // no highlights above this count: each frame draws all cubes
const kMinInterval_ms = 1000;  // between two requests

export class CubesView {
  constructor(path, signal) {
    this.path = path;
    this.signal = signal;
    this.cubes = [];
    this.turn = 0;  // quarter turns about the vertical axis
    this.next_fetch_ms = 0;
    this.canvas = h("canvas", {class: "cubes", role: "img"});
    this.note = h("p", {class: "faint"});
    this.turner = h("div", {class: "buttons"}, ...[[-1, "Turn left"], [1, "Turn right"]].map(([by, text]) =>
      h("button", {type: "button", class: "quiet small", on: {click: () => this.turn_by(by)}}, text)));
    this.element = h("div", {class: "cubes-view"}, this.canvas, h("div", {class: "split"}, this.note, this.turner));
    this.set_empty(true);
    this.say_why_empty(false, false);
    const scheme = matchMedia("(prefers-color-scheme: dark)");
    scheme.addEventListener("change", () => this.draw(), {signal});
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  // Fetches the cubes if the job has built more of them, at a limited rate.
  async update(job) {
    const {built, total} = job.progress?.subvolumes ?? {total: 0};
    const key = `${job.attempts} ${built} ${total} ${has_ended(job.state)}`;
    const say_if_empty = () => {
      if (!this.cubes.length) this.say_why_empty(has_ended(job.state), !total || key === this.key);
    };
    say_if_empty();
    if (!total || key === this.key || this.fetching) return;
    const wait_ms = this.next_fetch_ms - performance.now();
    if (wait_ms > 0) {
      this.timer ??= setTimeout(() => {
        this.timer = null;
        this.update(job);
      }, wait_ms);
      return;
    }
    this.fetching = true;
    const begin = performance.now();
    try {
      this.show(await get_json(this.path, this.signal));
      this.key = key;
    } catch (problem) {
      if (this.signal.aborted) return;
      if (problem.status === 404) this.key = key;  // not planned yet, or the job failed before planning
    } finally {
      this.fetching = false;
      say_if_empty();
      const now = performance.now();
      this.next_fetch_ms = now + Math.max(kMinInterval_ms, 10 * (now - begin));
    }
  }

  show({resolution, cubes, built, total}) {
    const before = new Map(this.cubes.map((cube) => [cube.key, cube]));
    const now = performance.now();
    this.resolution = resolution;
    this.cubes = cubes.map(([x, y, z, edge, is_built]) => {
      const key = `${x} ${y} ${z} ${edge}`;
      const old = before.get(key);
      const lit_at = !is_built ? null : !old ? -Infinity : old.lit_at ?? now;
      return {key, x, y, z, edge, lit_at, faces: {}};
    });
    this.set_empty(this.cubes.length === 0);
    this.order();
    this.draw();
    const text = `${count_text(built)} of ${count_text(total)} occupied subvolumes are built`;
    set_text(this.note, text);
    this.canvas.setAttribute("aria-label", text);
  }

  set_empty(empty) {
    this.canvas.hidden = this.turner.hidden = empty;
  }

  // Cubes of a job that has ended come only if it is tried again. `known`: the service has said that there are none.
  say_why_empty(ended, known) {
    if (this.resolution === undefined)
      set_text(this.note, !ended ? "Shown when the subvolumes are planned." : known ? "There are none." : "");
  }

  turn_by(by) {
    this.turn = (this.turn + by + 4) % 4;
    this.order();
    this.draw();
  }

  // The low corner of a cube after the rotation; y is up.
  turned({x, y, z, edge}) {
    const far = (c) => this.resolution - edge - c;
    return [[x, y, z], [z, y, far(x)], [far(x), y, far(z)], [far(z), y, x]][this.turn];
  }

  // Sorts the cubes from back to front. Octree cubes do not overlap, so the Morton order of their low
  // corners is correct for any mixture of sizes: no cube precedes one that is lower on all axes.
  order() {
    const min_edge = Math.min(...this.cubes.map((cube) => cube.edge));
    for (const cube of this.cubes) {
      cube.at = this.turned(cube);
      cube.rank = morton(...cube.at.map((c) => Math.floor(c / min_edge)));
    }
    this.cubes.sort((a, b) => a.rank - b.rank);
    // Faces that touch another cube of the same size are hidden.
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
      if (cube.lit_at === null) this.draw_pending(pen, colors, size, cube);
    const glows = this.cubes.length <= kMaxGlowing && !matchMedia("(prefers-reduced-motion: reduce)").matches;
    const now = performance.now();
    let glowing = false;
    for (const cube of this.cubes) {
      if (cube.lit_at === null) continue;
      const glow = glows ? Math.max(0, 1 - (now - cube.lit_at) / kGlow_ms) : 0;
      glowing ||= glow > 0;
      this.draw_built(pen, colors, size, cube, glow);
    }
    if (glowing && !this.signal.aborted) requestAnimationFrame(() => this.draw());
  }

  colors() {
    const style = getComputedStyle(this.canvas);
    const get = (name) => style.getPropertyValue(name).trim();
    return {top: get("--cube-top"), left: get("--cube-left"), right: get("--cube-right"), edge: get("--cube-edge"),
            wait: get("--cube-wait"), wait_edge: get("--cube-wait-edge"), frame: get("--line"), glow: get("--cube-glow")};
  }

  point(size, x, y, z) {
    return [kWidth / 2 + (x - z) * kCos * size,
            kMargin + (this.resolution + (x + z) * kSin - y) * size];
  }

  // The floor and the far edges of the grid.
  frame(pen, colors, size) {
    const r = this.resolution;
    const lines = [[[0, 0, 0], [r, 0, 0], [r, 0, r], [0, 0, r], [0, 0, 0]], [[0, 0, 0], [0, r, 0]],
                   [[0, r, r], [0, r, 0], [r, r, 0]], [[0, 0, r], [0, r, r]], [[r, 0, 0], [r, r, 0]]];
    pen.strokeStyle = colors.frame;
    pen.lineWidth = 1;
    for (const line of lines) {
      pen.beginPath();
      line.forEach(([x, y, z]) => pen.lineTo(...this.point(size, x, y, z)));
      pen.stroke();
    }
  }

  // Calls paint(face) for each visible face, with its path set.
  each_face(pen, size, {at: [x, y, z], edge}, paint) {
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

  draw_pending(pen, colors, size, cube) {
    const outlined = cube.edge * size >= kMinOutline_px;
    pen.lineWidth = 0.75;
    pen.strokeStyle = colors.wait_edge;
    pen.fillStyle = colors.wait;
    this.each_face(pen, size, cube, (face) => {
      if (!cube.faces[face]) return;
      pen.fill();
      if (outlined) pen.stroke();
    });
  }

  draw_built(pen, colors, size, cube, glow) {
    pen.lineWidth = 0.75;
    pen.strokeStyle = colors.edge;
    this.each_face(pen, size, cube, (face) => {
      pen.fillStyle = colors[face];
      pen.fill();
      if (glow > 0) {
        pen.globalAlpha = glow;
        pen.fillStyle = colors.glow;
        pen.fill();
        pen.globalAlpha = 1;
      }
      if (cube.edge * size >= kMinOutline_px) pen.stroke();
    });
  }
}

// Coordinates have up to 17 bits: a double represents the 51 bits of the code exactly.
function morton(x, y, z) {
  let code = 0;
  for (let bit = 2 ** 16; bit >= 1; bit /= 2) {
    code = code * 8 + (x & bit ? 4 : 0) + (y & bit ? 2 : 0) + (z & bit ? 1 : 0);
  }
  return code;
}
