// The wireframe of a job's subvolumes, drawn over the picture. Built, active and waiting subvolumes
// differ by line style, not by color alone. Lines behind surfaces are also visible, because the
// depth on the GPU is not used.

import {dot, subtract} from "../vector.js";

const kMaxEdges = 24000;  // with more edges, only active subvolumes are drawn
const kOpaque = 10;       // up to kOpaque^2 cubes of one kind are drawn opaque
const kNear = 1e-3;       // lines nearer to the eye than kNear/16 of the grid's edge are clipped

// Later styles are drawn over earlier ones.
export const kStyles = {
  waiting: {name: "waiting", color: "#5d6873", width: 1, dash: [3, 5]},
  built: {name: "built", color: "#15609b", width: 1, dash: []},
  working: {name: "being built", color: "#c25700", width: 3, dash: []},
};
const kOrder = Object.keys(kStyles);

export class SubvolumeWires {
  constructor(scene, onChange) {
    this.onChange = onChange;
    this.canvas = document.createElement("canvas");
    this.canvas.className = "wires";
    this.canvas.setAttribute("aria-hidden", "true");
    scene.after(this.canvas);
    this.edges = Object.fromEntries(kOrder.map((state) => [state, new Float64Array(0)]));
    this.counts = Object.fromEntries(kOrder.map((state) => [state, 0]));
    this.visible = true;
    this.drawsAll = true;  // false if only active subvolumes are drawn
    this.drawn = null;     // camera and size for which the wireframe was drawn
  }

  // Shows {resolution, cubes: [[x, y, z, edge, built]...], working: [[x, y, z, edge]...]}, all in
  // voxels. `working` is used only if the job `runs`.
  show({resolution, cubes, working = []}, runs) {
    this.resolution = resolution;
    const atWork = new Set(runs ? working.map((cube) => cube.join()) : []);
    const found = new Map();
    this.drawsAll = true;
    this.counts = Object.fromEntries(kOrder.map((state) => [state, 0]));
    for (const [x, y, z, edge, built] of cubes) {
      const rank = atWork.has([x, y, z, edge].join()) ? 2 : built ? 1 : 0;
      this.counts[kOrder[rank]]++;
      if (rank < 2 && !this.drawsAll) continue;
      addEdges(x, y, z, edge, rank, found);
      if (!this.drawsAll || found.size <= kMaxEdges) continue;
      this.drawsAll = false;
      for (const [key, known] of found)
        if (known.rank < 2) found.delete(key);
    }
    const lists = kOrder.map(() => []);
    for (const {rank, points} of found.values()) lists[rank].push(...points);
    kOrder.forEach((state, rank) => this.edges[state] = Float64Array.from(lists[rank]));
    this.drawn = null;
    this.onChange();
  }

  setVisible(visible) {
    this.visible = visible;
    this.canvas.hidden = !visible;
    this.onChange();
  }

  draw(camera) {
    if (!this.visible || !this.resolution) return;
    const {canvas} = this, width = canvas.clientWidth, height = canvas.clientHeight,
          ratio = window.devicePixelRatio || 1;
    if (!width || !height) return;
    // Thousands of lines take longer to draw than a part of a sample, so they are drawn only if the
    // camera or the size has changed.
    const {forward, up} = camera.axes(), drawn = [
      ...camera.eye, ...forward, ...up, camera.fovDegrees, width, height, ratio
    ].join();
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    if (canvas.width !== Math.round(width * ratio) ||
        canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const project = this.projection(camera, width, height);
    for (const state of kOrder) {
      const {color, width: line, dash} = kStyles[state];
      pen.strokeStyle = color;
      pen.lineWidth = line;
      pen.setLineDash(dash);
      // Many lines are drawn translucent: thousands of opaque lines would hide the voxels.
      pen.globalAlpha = Math.min(1, Math.max(0.25, kOpaque / Math.sqrt(this.counts[state])));
      pen.beginPath();
      const points = this.edges[state];
      for (let i = 0; i < points.length; i += 6) project(pen, points, i);
      pen.stroke();
    }
  }

  // Returns a function (pen, points, i) that adds the visible part of an edge to the path of the
  // pen. The edge's two ends are the six numbers of `points` from index i.
  projection(camera, width, height) {
    const {forward, right, up} = camera.axes(), eye = camera.eye,
                           pixel = camera.pixelSpread(height);
    const near = kNear * this.resolution / 16;
    const place = (points, at) => {
      const offset = subtract([points[at], points[at + 1], points[at + 2]], eye);
      return [dot(offset, right), dot(offset, up), dot(offset, forward)];
    };
    const cut = (from, to) => {
      const share = (near - from[2]) / (to[2] - from[2]);
      return from.map((c, i) => c + share * (to[i] - c));
    };
    const toPixels =
        ([x, y, depth]) => [width / 2 + x / depth / pixel, height / 2 - y / depth / pixel];
    return (pen, points, i) => {
      let a = place(points, i), b = place(points, i + 3);
      if (a[2] < near && b[2] < near) return;
      if (a[2] < near) a = cut(a, b);
      if (b[2] < near) b = cut(b, a);
      pen.moveTo(...toPixels(a));
      pen.lineTo(...toPixels(b));
    };
  }

  dispose() {
    this.canvas.remove();
  }
}

// Adds the twelve edges of a cube to `found`. If cubes of the same size share an edge, the edge is
// drawn only once, in the style of the cube with the highest rank.
function addEdges(x, y, z, edge, rank, found) {
  for (let axis = 0; axis < 3; ++axis)
    for (let corner = 0; corner < 4; ++corner) {
      const from = [x, y, z];
      from[(axis + 1) % 3] += (corner & 1) * edge;
      from[(axis + 2) % 3] += (corner >> 1) * edge;
      const key = `${from} ${axis} ${edge}`, known = found.get(key);
      if (known && known.rank >= rank) continue;
      const to = [...from];
      to[axis] += edge;
      found.set(key, {rank, points: [...from, ...to]});
    }
}
