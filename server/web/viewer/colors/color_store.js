// The color pages on the GPU: their words in a pool of blocks as that of the tiles, and a hash
// table by which the shaders find a page by its place. Pages that the view does not use leave when
// there is no room; the coarsest stay, so that there is always some color.

import {kRoundsToKnow} from "../tiles/loader.js";
import {TilePool} from "../tiles/tile_pool.js";

import {decodePage, kBlockWords, kMoreAt} from "./page_format.js";

const kRecentMs = 1500;
const kFreeShare = 1 / 64;                   // of the pool, that leaves at once
const kTableShare = 1 / 5;                   // of the budget
const kEntryBytes = 16, kTableWidth = 1024;  // the shaders know the width
const kMaxEntries = 2 ** 21;  // the pool has 2^20 blocks at most, and half of the entries stay free
const kCoarseLevel = 5;       // pages of this level and coarser ones stay: they are 76 at most

// The number of the pages along an axis.
function pagesOf(level) {
  return 2 ** Math.max(0, level - 3);
}
const kPagesBefore = [0];  // a level, of coarser ones
for (let level = 0; level < 20; ++level)
  kPagesBefore.push(kPagesBefore[level] + pagesOf(level) ** 3);
// A number for a page: below 2^52.
export function pageKey(level, x, y, z) {
  const n = pagesOf(level);
  return kPagesBefore[level] + (x * n + y) * n + z;
}

export class ColorStore {
  constructor(gl, budgetBytes) {
    this.gl = gl;
    const entries =
        Math.min(kMaxEntries, Math.max(kTableWidth, budgetBytes * kTableShare / kEntryBytes));
    this.entries = 2 ** Math.floor(Math.log2(entries));
    this.pool = new TilePool(gl, budgetBytes - this.entries * kEntryBytes);
    this.maxPages = this.entries / 2;
    this.table = this.pool.createTexture(gl.RGBA32UI, kTableWidth, this.entries / kTableWidth);
    this.words = new Uint32Array(4 * this.entries);  // what the table holds
    this.pages = new Map();                          // key -> page
    this.usedBlocks = 0;
    this.epoch = 0;
    this.rounds = 0;
    this.evicted = 0;
  }

  get bytes() {
    return this.pool.bytes + this.entries * kEntryBytes;
  }

  beginEpoch() {
    this.epoch++;
    this.rounds = 0;
  }

  // Stores a page as fetched. False if there is no room. Throws if the page is damaged.
  add({key, level, position}, pageWords, nowMs) {
    if (this.pages.has(key)) return true;
    const words = decodePage(pageWords), count = words.length / kBlockWords;
    if (!this.evictFor(count, nowMs)) return false;
    const [x, y, z] = position, blocks = this.pool.allocate(count);
    if (!blocks) return false;
    const page =
        {key, level, place: [x | level << 20, y, z], blocks, usedMs: nowMs, epoch: this.epoch};
    for (let i = 1; i < count; ++i) words[kMoreAt + i - 1] = blocks[i] * kBlockWords / 4;
    blocks.forEach(
        (block, i) => this.pool.write(
            block * kBlockWords / 4, words.subarray(i * kBlockWords, (i + 1) * kBlockWords)));
    // A page without cells is known, but not found by the shaders.
    if (count > 0) this.insert(page.place, blocks[0] + 1);
    this.pages.set(key, page);
    this.usedBlocks += count;
    return true;
  }

  // The page was seen in a picture of epoch `epoch`.
  mark(key, epoch, nowMs) {
    const page = this.pages.get(key);
    if (!page) return;
    page.usedMs = nowMs;
    if (epoch > page.epoch) page.epoch = epoch;
  }

  evictFor(count, nowMs) {
    const fits = (blocks, pages) =>
        this.pool.freeBlocks >= blocks && this.pages.size + pages <= this.maxPages;
    if (fits(count, 1)) return true;
    const maxUsedMs = nowMs - (this.rounds >= kRoundsToKnow ? 0 : kRecentMs);
    const candidates = [];
    for (const page of this.pages.values())
      if (page.level > kCoarseLevel && page.epoch !== this.epoch && page.usedMs < maxUsedMs)
        candidates.push(page);
    candidates.sort((a, b) => a.usedMs - b.usedMs);
    const more = this.pool.blockCount * kFreeShare;
    for (const page of candidates) {
      if (fits(count + more, 1 + more)) break;
      this.evicted++;
      this.pages.delete(page.key);
      if (page.blocks.length > 0) this.remove(page.place);
      this.pool.release(page.blocks);
      this.usedBlocks -= page.blocks.length;
    }
    return fits(count, 1);
  }

  // The table is probed from an entry's hash to the next free entry, of which there always are
  // some. An entry is x and the level, y, z, and the number of the page's first block plus 1; 0 is
  // free.
  insert(place, number) {
    let at = this.homeOf(place);
    while (this.words[4 * at + 3] !== 0) at = this.next(at);
    this.write(at, [...place, number]);
  }

  // Moves what follows back, so that no probe ends at the entry that becomes free.
  remove(place) {
    const {words} = this;
    let free = this.homeOf(place);
    while (place.some((word, i) => words[4 * free + i] !== word)) free = this.next(free);
    for (let at = this.next(free); words[4 * at + 3] !== 0; at = this.next(at)) {
      const home = this.homeOf(words.subarray(4 * at, 4 * at + 3));
      const mask = this.entries - 1;
      if ((at - home & mask) < (at - free & mask)) continue;  // its home lies behind the free one
      this.write(free, words.slice(4 * at, 4 * at + 4));
      free = at;
    }
    this.write(free, [0, 0, 0, 0]);
  }

  next(at) {
    return at + 1 & this.entries - 1;
  }

  homeOf([head, y, z]) {
    let hash = Math.imul(head, 0x8da6b343) ^ Math.imul(y, 0xd8163841) ^ Math.imul(z, 0xcb1ab31f);
    hash = Math.imul(hash ^ hash >>> 15, 0x2c1b3c6d);
    return (hash ^ hash >>> 13) & this.entries - 1;
  }

  write(at, entry) {
    const {gl} = this;
    this.words.set(entry, 4 * at);
    gl.bindTexture(gl.TEXTURE_2D, this.table);
    gl.texSubImage2D(
        gl.TEXTURE_2D, 0, at % kTableWidth, Math.floor(at / kTableWidth), 1, 1, gl.RGBA_INTEGER,
        gl.UNSIGNED_INT, this.words, 4 * at);
  }

  dispose() {
    this.pool.dispose();
    this.gl.deleteTexture(this.table);
  }
}
