// Stores color pages on the GPU: their words in a pool of blocks, like the pool of the tiles, and a
// hash table that maps the position of a page to its blocks. If the pool is full, pages that the
// view does not use are evicted. The coarsest pages are never evicted, so every cell has some
// color.

import {kRoundsToKnow} from "../tiles/loader.js";
import {TilePool} from "../tiles/tile_pool.js";

import {decodePage, kBlockWords, kMoreAt} from "./page_format.js";

// In the first kRoundsToKnow (tiles/loader.js) readings of a view, pages that were used within this
// time are not evicted, because the view possibly still uses them.
const kRecentMs = 1500;
const kFreeShare = 1 / 64;                   // share that an eviction frees beyond the need
const kTableShare = 1 / 5;                   // share of the budget for the hash table
const kEntryBytes = 16, kTableWidth = 1024;  // the shaders contain the same table width
// Maximum number of entries of the hash table. The pool has at most 2^20 blocks, so half of the
// entries remain free.
const kMaxEntries = 2 ** 21;
const kCoarseLevel = 5;  // pages of this and all coarser levels (at most 76) are never evicted

// Returns the number of pages along an axis of the grid.
function pagesOf(level) {
  return 2 ** Math.max(0, level - 3);
}
const kPagesBefore = [0];  // by level: number of pages on all coarser levels
for (let level = 0; level < 20; ++level)
  kPagesBefore.push(kPagesBefore[level] + pagesOf(level) ** 3);
// Returns a unique number for a page, below 2^52.
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
    this.words = new Uint32Array(4 * this.entries);  // the content of the table
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

  // Stores a fetched page. Returns false if the pool has no space. Throws if the page is damaged.
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
    // A page without cells is kept here, but gets no entry in the shaders' hash table.
    if (count > 0) this.insert(page.place, blocks[0] + 1);
    this.pages.set(key, page);
    this.usedBlocks += count;
    return true;
  }

  // Marks a page as used by a picture that was drawn for `epoch` (tiles/tile_store.js).
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

  // Adds an entry to the hash table. `place` has the position and the level of a page. `number` is
  // 1 plus the number of the page's first block. A search (probe) starts at the hash of the page
  // and ends at the next free entry; some entries are always free. An entry has four words: the
  // three words of `place` (x with the level, y, z) and `number`. In a free entry, the last word is
  // 0.
  insert(place, number) {
    let at = this.homeOf(place);
    while (this.words[4 * at + 3] !== 0) at = this.next(at);
    this.write(at, [...place, number]);
  }

  // Frees the entry of a page. Moves later entries back, so that no probe ends too early at the
  // freed entry.
  remove(place) {
    const {words} = this;
    let free = this.homeOf(place);
    while (place.some((word, i) => words[4 * free + i] !== word)) free = this.next(free);
    for (let at = this.next(free); words[4 * at + 3] !== 0; at = this.next(at)) {
      const home = this.homeOf(words.subarray(4 * at, 4 * at + 3));
      const mask = this.entries - 1;
      // The probe for this entry starts after the free entry, so this entry is not moved.
      if ((at - home & mask) < (at - free & mask)) continue;
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
