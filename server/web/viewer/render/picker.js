// Finds the voxel at a point of the canvas.

import {add, scale} from "../vector.js";

// Resolves to the voxel that `renderer` shows at a point, given in CSS pixels; to null for the sky.
export async function pickVoxel(renderer, cssX, cssY) {
  const {passes} = renderer.context;
  if (!renderer.canPick || !await passes.compileLater()) return null;
  if (!renderer.canPick || passes !== renderer.context.passes) return null;
  const {view, stream: {store}} = renderer, {width, height, cssWidth, cssHeight} = renderer.size;
  const {evicted} = store;
  const x = cssX / cssWidth * width, y = cssY / cssHeight * height;
  const values = renderer.uniforms(width, height);
  values.u_center = [width / 2 - x + 0.5, y - height / 2 + 0.5];
  const words = await passes.pickOne(values);
  if (!words || !renderer.isReady || (words[1] >>> 23 & 1) === 0) return null;
  // The hit refers to tiles by their slots. If a tile was evicted after the pick began, its slot
  // may now belong to another tile, so the pick is repeated.
  if (store.evicted !== evicted) return pickVoxel(renderer, cssX, cssY);
  return hitOf(words, view.eye, view.direction(x, y, width, height), store, renderer.info);
}

// Decodes the words that pickOne() (gl/passes.js) returns for a hit.
function hitOf(words, eye, direction, store, info) {
  const distance = new Float32Array(words.buffer, 0, 1)[0], axis = words[1] >>> 21 & 3;
  const normal = axis === 3 ? direction.map((d) => -d) : [0, 0, 0];
  if (axis < 3) normal[axis] = direction[axis] > 0 ? -1 : 1;
  const node =
      words[2] !== 0 ? store.cutOffNode(words[2]) : store.bySlot[words[7]]?.tile || info.root;
  return {
    voxel: [...words.slice(4, 7)],
    level: info.levels - (words[1] >>> 16 & 31),
    position: add(eye, scale(direction, distance)),
    distance,
    normal,
    nodeLevel: node.level,
    nodeOffset: String(node.offset)
  };
}
