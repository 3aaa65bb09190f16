// The colors of a file: the uniforms for drawing them, and requests for the missing pages, which
// the color feedback (gl/color_shader.js) reports.

import {ColorLoader} from "./color_loader.js";
import {ColorStore, pageKey} from "./color_store.js";

const kMebibyte = 1 << 20;
const kBudgetShare = 1 / 4;   // share of colors in the budget of tiles and colors
const kMinBytes = 96 * 1024;  // minimum for a pool and a hash table together
// Worst case: each voxel needs a page on the finest level and a page on a coarser level.
const kBytesPerVoxel = 1024;
const kBaseBelow = 2;  // levels between a wanted page and the coarser page to request first
// The last word of a feedback texel (gl/color_shader.js) is 0, or 1 plus the number of pixels whose
// page is missing. So a page is missing if the word is at least kWanted.
const kWanted = 2;

// Returns the part of the budget for the colors of a file.
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

  // Requests the missing pages and marks the used pages. `words` is the color feedback of a picture
  // that was drawn for `epoch` (tiles/tile_store.js).
  takeReading(words, epoch, nowMs) {
    const wanted = new Map();
    for (let at = 0; at < words.length; at += 4) {
      const head = words[at], y = words[at + 1], z = words[at + 2], state = words[at + 3];
      if (state === 0) continue;
      if (state < kWanted) {
        // Neighboring texels usually use the same page.
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

  // Adds a page to `wanted`. Its priority is the number of pixels that need it. A coarse page
  // covers more pixels than a fine page, so coarse pages are requested first. So every part of the
  // picture has colors, even if the memory is too small for all pages.
  want(wanted, level, position, pixels) {
    const key = pageKey(level, ...position), request = wanted.get(key);
    if (request) request.priority += pixels;
    else wanted.set(key, {key, level, position, priority: pixels});
  }

  // Marks the coarser page that is drawn instead of a missing page. Returns the coarser page's
  // level; -1 if no coarser page is loaded.
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
