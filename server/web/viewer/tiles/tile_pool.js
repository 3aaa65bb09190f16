// The GPU's memory for tiles. It consists of a texture of four-word texels, divided into blocks,
// and a table that contains, for each slot (tile_store.js), the pointer to the slot's tile. A tile
// uses any free blocks, so memory does not fragment. Only few views need much memory, so a large
// pool starts small and grows to its final size in one step. During this step, both the old and the
// new texture exist; together they do not exceed the budget. If the GPU has no memory for the
// larger texture, the pool keeps its size.

import {kBlockTexels, kTexelWords} from "./tile_format.js";

const kRowTexels = 4096, kTableWidth = 1024;  // texture widths, also in the shaders
const kMaxRows = 4096;                        // limited, because addresses of texels have 24 bits
const kBlocksPerRow = kRowTexels / kBlockTexels;
const kTexelBytes = kTexelWords * 4;
const kFirstRows = 256;  // initial size of a growing pool: 16 MiB
const kErrorFlags = 8;   // upper bound of the number of error flags in WebGL

export class TilePool {
  constructor(gl, budgetBytes) {
    this.gl = gl;
    // A tile has at least one block, so there are at most as many slots as blocks. The table has
    // one entry for each slot.
    const rowBytes = kRowTexels * kTexelBytes + kBlocksPerRow * 4;
    const rows = Math.floor((budgetBytes - kTableWidth * 4) / rowBytes);
    if (rows < 1) throw new Error(`A budget of ${budgetBytes} bytes is too small for the viewer.`);
    const grows = rows >= 4 * kFirstRows;
    this.maxRows =
        Math.min(grows ? rows - kFirstRows : rows, kMaxRows, gl.getParameter(gl.MAX_TEXTURE_SIZE));
    this.rows = grows ? kFirstRows : this.maxRows;
    this.blockCount = this.maxRows * kBlocksPerRow;  // number of blocks at the final size
    this.tableRows = Math.ceil(this.blockCount / kTableWidth);
    this.slotCount = this.tableRows * kTableWidth;
    this.texels = this.createTexture(gl.RGBA32UI, kRowTexels, this.rows);
    this.table = this.createTexture(gl.R32UI, kTableWidth, this.tableRows);
    this.free = [];      // blocks that were used and released
    this.nextBlock = 0;  // number of the first block that was never used
    this.freeSlots = [];
    this.nextSlot = 1;  // slot 0 means none
  }

  get bytes() {
    return this.rows * kRowTexels * kTexelBytes + this.slotCount * 4;
  }
  get freeBlocks() {
    return this.free.length + this.blockCount - this.nextBlock;
  }

  // Returns the numbers of `count` free blocks; null if too few blocks are free, or if the pool
  // cannot grow for them.
  allocate(count) {
    if (this.freeBlocks < count) return null;
    const end = this.nextBlock + Math.max(0, count - this.free.length);
    if (end > this.rows * kBlocksPerRow && !this.grow()) return null;
    const blocks = new Uint32Array(count);
    for (let i = 0; i < count; ++i)
      blocks[i] = this.free.length > 0 ? this.free.pop() : this.nextBlock++;
    return blocks.sort();
  }

  // Replaces the texture by a larger one. If the GPU has no memory for it, keeps the old texture
  // and returns false.
  grow() {
    const {gl} = this, before = this.texels;
    for (let flags = 0; flags < kErrorFlags && gl.getError() !== gl.NO_ERROR; ++flags)
      ;  // clears the errors of earlier calls
    const texels = this.createTexture(gl.RGBA32UI, kRowTexels, this.maxRows);
    if (gl.getError() !== gl.NO_ERROR) {
      gl.deleteTexture(texels);
      this.maxRows = this.rows;
      this.blockCount = this.rows * kBlocksPerRow;
      return false;
    }
    const framebuffer = gl.createFramebuffer();
    this.texels = texels;
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, before, 0);
    gl.readBuffer(gl.COLOR_ATTACHMENT0);
    gl.copyTexSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 0, 0, kRowTexels, this.rows);
    gl.deleteFramebuffer(framebuffer);
    gl.deleteTexture(before);
    this.rows = this.maxRows;
    return true;
  }

  release(blocks) {
    for (let i = blocks.length - 1; i >= 0; --i) this.free.push(blocks[i]);
  }

  allocateSlot() {
    if (this.freeSlots.length > 0) return this.freeSlots.pop();
    return this.nextSlot < this.slotCount ? this.nextSlot++ : 0;
  }
  get hasFreeSlot() {
    return this.freeSlots.length > 0 || this.nextSlot < this.slotCount;
  }
  releaseSlot(slot) {
    this.freeSlots.push(slot);
  }

  // Writes a decoded tile to its blocks. Returns the pointer to the root of the tile.
  upload(blocks, {words, pointers, root}) {
    const absolute = (pointer) => {
      const texel = pointer >>> 8;
      return (blocks[Math.floor(texel / kBlockTexels)] * kBlockTexels + texel % kBlockTexels) *
          256 +
          (pointer & 255);
    };
    for (const at of pointers) words[at] = absolute(words[at]);
    for (let first = 0; first < blocks.length;) {
      let last = first + 1;
      while (last < blocks.length && blocks[last] === blocks[first] + last - first &&
             blocks[last] % kBlocksPerRow !== 0)
        ++last;
      const blockWords = kBlockTexels * kTexelWords;
      this.write(
          blocks[first] * kBlockTexels, words.subarray(first * blockWords, last * blockWords));
      first = last;
    }
    return absolute(root);
  }

  // Writes texels within one row.
  write(texel, words) {
    const {gl} = this;
    gl.bindTexture(gl.TEXTURE_2D, this.texels);
    gl.texSubImage2D(
        gl.TEXTURE_2D, 0, texel % kRowTexels, Math.floor(texel / kRowTexels),
        words.length / kTexelWords, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
  }

  // Sets the pointer to the root of the slot's tile. 0 means that the tile is not loaded.
  setSlot(slot, pointer) {
    const {gl} = this;
    gl.bindTexture(gl.TEXTURE_2D, this.table);
    gl.texSubImage2D(
        gl.TEXTURE_2D, 0, slot % kTableWidth, Math.floor(slot / kTableWidth), 1, 1, gl.RED_INTEGER,
        gl.UNSIGNED_INT, Uint32Array.of(pointer));
  }

  dispose() {
    this.gl.deleteTexture(this.texels);
    this.gl.deleteTexture(this.table);
  }

  createTexture(format, width, height) {
    const {gl} = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
    return texture;
  }
}
