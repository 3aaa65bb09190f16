// The directory of a package (docs/format.md, "Packages"), which has the position of each block in
// the packs. Its pages are fetched when they are needed, several neighboring pages with one
// request. The index of the package has the positions of the blocks in the head.
//
// A block has a number. Blocks in packs have the numbers 0, 1, ..., in the order in which they are
// stored. The n blocks in the head have the numbers -n, ..., -1.

import {TileError} from "../tile_source.js";

import {gunzip} from "./block_format.js";

const kPageBlocks = 4096;
const kBlockTiles = 64;
const kGroupBytes = 1 << 16;  // minimum size of the pages that one request fetches

export class Directory {
  constructor(files, {bands, head, directory, packs}) {
    Object.assign(this, {files, bands, packs});
    this.head = head ? {name: head.name, bytes: head.bytes} : null;
    this.headLengths = head?.blocks ?? [];
    this.file = {name: directory.name, bytes: directory.bytes};
    this.pages = directory.pages;
    this.loaded = new Map();  // page -> promise of the result of parse()
    this.blockCount = 0;      // in packs
    this.firstBlocks = [];    // by band: its first block in a pack
    this.headBlocks = [];     // by band: the number of its blocks in the head
    this.headBegins = [];     // by band: the index of its first block in the head
    let at = 0;
    for (const {blocks, head_tiles: headTiles = 0} of bands) {
      const inHead = Math.ceil(headTiles / kBlockTiles);
      this.headBlocks.push(inHead);
      this.headBegins.push(at);
      at += inHead;
      this.firstBlocks.push(this.blockCount);
      this.blockCount += blocks - inHead;
    }
    if (at !== this.headLengths.length) throw new TileError(200, "The package has a wrong head.");
    at = 0;
    this.headOffsets = this.headLengths.map((length) => (at += length) - length);
    at = 0;
    this.offsets = this.pages.map(({bytes}) => (at += bytes) - bytes);
    this.groups = groupsOf(this.pages);  // by page: [first page, last page] of its group
    at = 0;
    this.packBlocks = packs.map(({blocks}) => (at += blocks) - blocks);  // by pack: its first block
  }

  // Returns the number of the block that has a tile of a band.
  tileBlock(band, tile) {
    const i = Math.floor(tile / kBlockTiles), inHead = this.headBlocks[band];
    return i < inHead ? this.headBegins[band] + i - this.headLengths.length :
                        this.firstBlocks[band] + i - inHead;
  }

  // Returns {band, index}: the band of a block, and the index of the block in this band.
  bandOf(block) {
    const isInHead = block < 0, begins = isInHead ? this.headBegins : this.firstBlocks;
    const at = isInHead ? block + this.headLengths.length : block;
    const band = begins.findLastIndex((first) => first <= at);
    return {band, index: at - begins[band] + (isInHead ? 0 : this.headBlocks[band])};
  }

  // Resolves to {file, offset, bytes}: the file of a block, {name, bytes}, the offset of the block
  // in this file, and its compressed size.
  async place(block, options) {
    if (block < 0) {
      const at = block + this.headLengths.length;
      return {file: this.head, offset: this.headOffsets[at], bytes: this.headLengths[at]};
    }
    const page = Math.floor(block / kPageBlocks), entries = await this.page(page, options);
    const i = block - page * kPageBlocks;
    const file = this.packs[entries.packs[i]];
    return {file, offset: entries.offsets[i], bytes: entries.lengths[i]};
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
    if (!this.loaded.has(page)) this.loadGroup(page, options);
    return this.loaded.get(page);
  }

  // Begins to load all pages of the group of `page`.
  loadGroup(page, options) {
    const [first, last] = this.groups[page], begin = this.offsets[first];
    const reads = this.files.read(
        this.file, begin, this.offsets[last] + this.pages[last].bytes - begin, options);
    for (let each = first; each <= last; ++each) {
      const loads = this.load(each, reads, begin);
      this.loaded.set(each, loads);
      loads.catch(() => this.loaded.delete(each));
    }
  }

  // Takes a page from the bytes of its group. These begin at the offset `begin` of the directory.
  async load(page, reads, begin) {
    const offset = this.offsets[page] - begin;
    const part = (await reads).subarray(offset, offset + this.pages[page].bytes);
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

// Divides the pages of a directory into groups. The first page, which every view needs, is a group.
// Returns, for each page, the first and the last page of its group.
function groupsOf(pages) {
  const groups = [];
  while (groups.length < pages.length) {
    const first = groups.length;
    let last = first, bytes = pages[first].bytes;
    while (first > 0 && last + 1 < pages.length && bytes < kGroupBytes)
      bytes += pages[++last].bytes;
    while (groups.length <= last) groups.push([first, last]);
  }
  return groups;
}
