// The wireframe of a job's subvolumes, drawn over the picture. Built, active and waiting subvolumes
// differ by line style, not by color alone. Lines behind surfaces are also visible, because the
// depth on the GPU is not used.

import {Projection} from "../projection.js";

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
    const projection = new Projection(camera, width, height, kNear * this.resolution / 16);
    for (const state of kOrder) {
      const {color, width: line, dash} = kStyles[state];
      pen.strokeStyle = color;
      pen.lineWidth = line;
      pen.setLineDash(dash);
      // Many lines are drawn translucent: thousands of opaque lines would hide the voxels.
      pen.globalAlpha = Math.min(1, Math.max(0.25, kOpaque / Math.sqrt(this.counts[state])));
      pen.beginPath();
      const points = this.edges[state];
      for (let i = 0; i < points.length; i += 6) {
        const ends = projection.line(points.subarray(i, i + 3), points.subarray(i + 3, i + 6));
        if (!ends) continue;
        pen.moveTo(...ends[0]);
        pen.lineTo(...ends[1]);
      }
      pen.stroke();
    }
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
