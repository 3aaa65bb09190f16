// The colors of a file: what the shaders need to draw them, and what a reading of the feedback says
// of them.

import {ColorLoader} from "./color_loader.js";
import {ColorStore, pageKey} from "./color_store.js";

const kMebibyte = 1 << 20;
const kBudgetShare = 1 / 4;   // of that of tiles and colors
const kMinBytes = 96 * 1024;  // a pool and a hash table take no less
const kBytesPerVoxel = 1024;  // at worst: a page for each voxel, as many again on coarser levels
const kBaseBelow =
    2;  // levels: of a wanted page a coarser one comes first, unless one as fine is there
const kWanted = 2;  // of the feedback's last word, the least: so many pixels want the page

// How much of the budget the colors of a file take.
export function colorBudget(info, budgetBytes) {
  if (!info.colors) return 0;
  return Math.min(
      Math.max(budgetBytes * kBudgetShare, kMinBytes),
      kMebibyte + Number(info.voxels) * kBytesPerVoxel);
}

export class Colors {
  constructor(gl, source, budgetBytes, onArrival) {
    this.levels = source.info.colors.levels;
    this.store = new ColorStore(gl, budgetBytes);
    this.loader = new ColorLoader(source, this.store, onArrival);
  }

  beginEpoch() {
    this.store.beginEpoch();
    this.loader.beginEpoch();
  }

  uniforms() {
    const {store} = this;
    return {
      u_page_texels: store.pool.texels,
      u_page_table: store.table,
      u_page_mask: store.entries - 1,
      u_color_levels: this.levels
    };
  }

  // Takes the words that kColorFeedback wrote for a picture of an epoch.
  takeReading(words, epoch, nowMs) {
    const wanted = new Map();
    for (let at = 0; at < words.length; at += 4) {
      const head = words[at], y = words[at + 1], z = words[at + 2], state = words[at + 3];
      if (state === 0) continue;
      if (state < kWanted) {
        // Neighbors mostly use one page.
        if (at > 0 && head === words[at - 4] && y === words[at - 3] && z === words[at - 2] &&
            words[at - 1] === state)
          continue;
        this.store.mark(pageKey(head >>> 20, head & 0xfffff, y, z), epoch, nowMs);
        continue;
      }
      const level = head >>> 20, position = [head & 0xfffff, y, z];
      this.want(wanted, level, position, state);
      const drawn = this.markCoarser(level, position, epoch, nowMs);
      if (level - drawn > kBaseBelow && level >= kBaseBelow)
        this.want(wanted, level - kBaseBelow, position.map((at) => at >>> kBaseBelow), state);
    }
    if (epoch === this.store.epoch) this.store.rounds++;
    this.loader.demand(wanted, nowMs);
  }

  // Pages for more pixels come first: so coarser ones, and where memory ends, no part of the
  // picture is without them.
  want(wanted, level, position, pixels) {
    const key = pageKey(level, ...position), request = wanted.get(key);
    if (request) request.priority += pixels;
    else wanted.set(key, {key, level, position, priority: pixels});
  }

  // The page whose color is on the screen while this one is missing is in use. Returns its level,
  // -1 if there is none.
  markCoarser(level, position, epoch, nowMs) {
    for (let coarser = level - 1; coarser >= 0; --coarser) {
      position = position.map((at) => at >>> 1);
      const key = pageKey(coarser, ...position);
      if (!this.store.pages.has(key)) continue;
      this.store.mark(key, epoch, nowMs);
      return coarser;
    }
    return -1;
  }

  dispose() {
    this.loader.dispose();
    this.store.dispose();
  }
}
