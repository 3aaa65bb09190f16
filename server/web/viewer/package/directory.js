// The directory of a package (docs/format.md, "Packages"), which has the position of each block. A
// small directory is fetched in one piece, a large one page by page.

import {TileError} from "../tile_source.js";

import {gunzip} from "./block_format.js";

const kPageBlocks = 4096;
const kMaxWholeBytes = 1 << 20;

export class Directory {
  constructor(files, {bands, directory, packs}) {
    Object.assign(this, {files, bands, packs});
    this.file = {name: directory.name, bytes: directory.bytes};
    this.pages = directory.pages;
    this.loaded = new Map();  // page -> promise of the result of parse()
    this.blockCount = 0;
    this.firstBlocks = [];  // by band: its first block
    for (const {blocks} of bands) {
      this.firstBlocks.push(this.blockCount);
      this.blockCount += blocks;
    }
    let at = 0;
    this.offsets = this.pages.map(({bytes}) => (at += bytes) - bytes);
    at = 0;
    this.packBlocks = packs.map(({blocks}) => (at += blocks) - blocks);  // by pack: its first block
  }

  // Resolves to {pack, offset, bytes}: the pack of a block, its offset in the pack, and its
  // compressed size.
  async place(block, options) {
    const page = Math.floor(block / kPageBlocks), entries = await this.page(page, options);
    const i = block - page * kPageBlocks;
    return {pack: entries.packs[i], offset: entries.offsets[i], bytes: entries.lengths[i]};
  }

  // Resolves to the only block of a color band that can contain the page with the Morton code
  // `code`: the last block whose first page has a code of at most `code`.
  async colorBlock(band, code, options) {
    const begin = this.firstBlocks[band], end = begin + this.bands[band].blocks;
    const lastPage = Math.floor((end - 1) / kPageBlocks);
    let page = Math.floor(begin / kPageBlocks);
    while (page < lastPage && this.pages[page + 1].code <= code) ++page;
    const {codes} = await this.page(page, options);
    let low = Math.max(begin, page * kPageBlocks), high = Math.min(end, (page + 1) * kPageBlocks);
    while (high - low > 1) {
      const middle = low + high >>> 1;
      if (codes[middle - page * kPageBlocks] <= code) low = middle;
      else high = middle;
    }
    return low;
  }

  page(page, options) {
    if (!this.loaded.has(page)) {
      const loads = this.load(page, options);
      this.loaded.set(page, loads);
      loads.catch(() => this.loaded.delete(page));
    }
    return this.loaded.get(page);
  }

  async load(page, options) {
    const {files, file} = this, isWhole = file.bytes <= kMaxWholeBytes;
    const offset = this.offsets[page], {bytes} = this.pages[page];
    const part = isWhole ?
        (await files.read(file, 0, file.bytes, options)).subarray(offset, offset + bytes) :
        await files.read(file, offset, bytes, options);
    try {
      return this.parse(page, await gunzip(part));
    } catch (error) {
      throw new TileError(200, `The directory is damaged: ${error.message}`);
    }
  }

  // Returns {packs, offsets, lengths, codes}, arrays with an element for each block of a page of
  // the directory. `bytes` is the decompressed page.
  parse(page, bytes) {
    const first = page * kPageBlocks, count = Math.min(kPageBlocks, this.blockCount - first);
    const isColor = this.colorFlags(first, count), colored = isColor.reduce((sum, c) => sum + c, 0);
    if (bytes.length !== 2 * count + 8 * colored) throw new Error("a page has a wrong length.");
    const view = new DataView(bytes.buffer, bytes.byteOffset);
    const entries = {
      packs: new Uint32Array(count),
      offsets: new Uint32Array(count),
      lengths: new Uint16Array(count),
      codes: new Float64Array(count)
    };
    let {pack, offset} = this.pages[page], color = 2 * count;
    for (let i = 0; i < count; ++i) {
      if (first + i === this.packBlocks[pack + 1]) {
        ++pack;
        offset = 0;
      }
      entries.packs[i] = pack;
      entries.offsets[i] = offset;
      entries.lengths[i] = view.getUint16(2 * i, true);
      offset += entries.lengths[i];
      if (offset > this.packs[pack].bytes) throw new Error("the blocks exceed their pack.");
      if (!isColor[i]) continue;
      entries.codes[i] =
          view.getUint32(color, true) + view.getUint32(color + 4 * colored, true) * 2 ** 32;
      color += 4;
    }
    return entries;
  }

  colorFlags(first, count) {
    const flags = new Uint8Array(count);
    this.bands.forEach((band, i) => {
      const begin = this.firstBlocks[i] - first;
      if (band.pages !== undefined)
        flags.fill(1, Math.max(0, begin), Math.max(0, begin + band.blocks));
    });
    return flags;
  }
}
