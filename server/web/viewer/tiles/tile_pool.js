// The GPU's memory for tiles: words in unsigned integer textures, divided into blocks, and the table
// that says for each slot where its tile begins. A tile takes any free blocks, so memory does not
// fragment. The textures (segments) are created when they are needed; all of them together with the
// table never exceed the budget.

import {kBlockWords} from "./tile_format.js";

export const kRowWords = 4096;     // texture width
export const kSegments = 4;        // a shader's samplers cannot be indexed, so they are few
const kTableWidth = 1024;
const kBlocksPerRow = kRowWords / kBlockWords;

export class TilePool {
  constructor(gl, budget_bytes) {
    this.gl = gl;
    // A block of 64 words and its entry of the table: a tile has one block or more.
    const rows = Math.floor(budget_bytes / (kRowWords * 4 + kBlocksPerRow * 4 + 4));
    const max_rows = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    this.segment_rows = Math.max(1, Math.min(Math.floor(rows / kSegments), max_rows));
    this.segment_words = this.segment_rows * kRowWords;
    this.block_count = this.segment_rows * kSegments * kBlocksPerRow;
    this.table_rows = Math.ceil((this.block_count + 1) / kTableWidth);
    this.slot_count = this.table_rows * kTableWidth;
    this.free = [];           // block numbers
    this.segments = [];
    this.free_slots = [];
    this.next_slot = 1;       // slot 0 means none
    this.create_table();
  }

  get bytes() {
    return this.segments.length * this.segment_words * 4 + this.slot_count * 4;
  }
  get free_blocks() {
    return this.free.length + (kSegments - this.segments.length) * this.segment_rows * kBlocksPerRow;
  }

  // Block numbers, or null if there are not so many free ones.
  allocate(count) {
    if (this.free_blocks < count) return null;
    while (this.free.length < count) this.add_segment();
    const blocks = new Uint32Array(count);
    for (let i = 0; i < count; ++i) blocks[i] = this.free.pop();
    return blocks.sort();
  }
  release(blocks) {
    for (let i = blocks.length - 1; i >= 0; --i) this.free.push(blocks[i]);
  }

  allocate_slot() {
    if (this.free_slots.length > 0) return this.free_slots.pop();
    return this.next_slot < this.slot_count ? this.next_slot++ : 0;
  }
  release_slot(slot) {
    this.free_slots.push(slot);
  }

  // Writes a decoded tile to its blocks. Returns the address of its root.
  upload(blocks, {words, pointers}) {
    const absolute = (address) => blocks[address / kBlockWords | 0] * kBlockWords + address % kBlockWords;
    for (const pointer of pointers) words[pointer] = absolute(words[pointer]);
    for (let first = 0; first < blocks.length;) {
      let last = first + 1;
      while (last < blocks.length && blocks[last] === blocks[first] + last - first &&
             blocks[last] % kBlocksPerRow !== 0) ++last;
      this.write(blocks[first] * kBlockWords, words.subarray(first * kBlockWords, last * kBlockWords));
      first = last;
    }
    return blocks[0] * kBlockWords;
  }

  // Words within one row.
  write(address, words) {
    const {gl} = this;
    const segment = Math.floor(address / this.segment_words), within = address % this.segment_words;
    gl.bindTexture(gl.TEXTURE_2D, this.segments[segment]);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, within % kRowWords, Math.floor(within / kRowWords), words.length, 1,
                     gl.RED_INTEGER, gl.UNSIGNED_INT, words);
  }

  // `address` of the slot's tile plus 1; 0 if it has none.
  set_slot(slot, entry) {
    const {gl} = this;
    gl.bindTexture(gl.TEXTURE_2D, this.table);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, slot % kTableWidth, Math.floor(slot / kTableWidth), 1, 1,
                     gl.RED_INTEGER, gl.UNSIGNED_INT, Uint32Array.of(entry));
  }

  // Binds the segments to texture units first, first + 1, ... and the table to the one after them.
  bind(first) {
    const {gl} = this;
    for (let i = 0; i <= kSegments; ++i) {
      gl.activeTexture(gl.TEXTURE0 + first + i);
      gl.bindTexture(gl.TEXTURE_2D, i === kSegments ? this.table : this.segments[i] || this.table);
    }
    gl.activeTexture(gl.TEXTURE0);
  }

  dispose() {
    for (const texture of [...this.segments, this.table]) this.gl.deleteTexture(texture);
  }

  create_table() {
    this.table = this.create_texture(kTableWidth, this.table_rows);
  }
  add_segment() {
    const first = this.segments.length * this.segment_rows * kBlocksPerRow;
    this.segments.push(this.create_texture(kRowWords, this.segment_rows));
    const count = this.segment_rows * kBlocksPerRow;
    this.free = Array.from({length: count}, (_, i) => first + count - 1 - i).concat(this.free);
  }
  create_texture(width, height) {
    const {gl} = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.R32UI, width, height);
    return texture;
  }
}
