// Decodes the blocks of a package (docs/format.md, "Packages"). Blocks come from the network and
// may be damaged. All counts in them are checked, so a damaged block causes an error.

const kTileMagic = 0x31544456;

const kPopcount = Uint8Array.from({length: 256}, (_, i) => {
  let bits = 0;
  for (let rest = i; rest; rest &= rest - 1) ++bits;
  return bits;
});

// Reads the columns of a block one after the other. Throws an error after the end of the block.
class Columns {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }
  take(count) {
    if (this.at + count > this.bytes.length) throw new Error("A block ends too early.");
    this.at += count;
    return this.bytes.subarray(this.at - count, this.at);
  }
  takeWord() {
    const bytes = this.take(4);
    return (bytes[0] | bytes[1] << 8 | bytes[2] << 16 | bytes[3] << 24) >>> 0;
  }
  // Reads the masks of `count` leaves. The first byte of a leaf tells which bytes of its mask are
  // stored; the other bytes are 0. Returns the low and the high halves of the masks.
  takeMasks(count) {
    const {bytes} = this, low = new Uint32Array(count), high = new Uint32Array(count);
    let at = this.at;
    for (let i = 0; i < count; ++i) {
      const stored = bytes[at++];
      if (stored === 0) throw new Error("A block has a leaf without cells.");
      for (let byte = 0; byte < 8; ++byte) {
        if ((stored >>> byte & 1) === 0) continue;
        if (bytes[at] === 0) throw new Error("A block stores a byte of a leaf that is 0.");
        (byte < 4 ? low : high)[i] |= bytes[at++] << 8 * (byte & 3);
      }
    }
    this.take(at - this.at);
    return {low, high};
  }
  expectEnd() {
    if (this.at !== this.bytes.length) throw new Error("A block has bytes after its columns.");
  }
}

// A block of tiles. Stores the block in expanded form, and makes the words of a tile
// (docs/format.md, "Tiles") when they are requested.
export class TileBlock {
  // `bytes` is the decompressed block. `level` is the level of the roots of the tiles. The third
  // argument is the tileShape() of this level. `count` is the number of tiles.
  constructor(bytes, level, {levels, bricks}, count) {
    const columns = new Columns(bytes), next = columns.takeWord();
    Object.assign(this, {level, levels, bricks, count});
    this.size = bytes.length;
    this.masks = [];  // by level of the tiles: the child masks of all nodes
    // By level: the index of the first node of each tile. The last entry has the index of the first
    // leaf of each tile.
    this.starts = [];
    let starts = Uint32Array.from({length: count + 1}, (_, i) => i);
    for (let i = 0; i < levels; ++i) {
      const masks = columns.take(starts[count]);
      this.masks.push(masks);
      this.starts.push(starts);
      starts = childStarts(masks, starts);
    }
    this.starts.push(starts);
    const leaves = starts[count];
    Object.assign(this, columns.takeMasks(leaves));
    this.numbers = bricks ? null : readNumbers(columns, leaves, next);
    columns.expectEnd();
  }

  // Returns the words of tile `index` of the block. Equal nodes and equal leaves of the tile are
  // stored once.
  tile(index) {
    const {levels, bricks} = this, leaves = [];
    let children = this.leavesOf(index, leaves);
    const nodes = new Array(levels);
    for (let level = levels; level-- > 0;) {
      nodes[level] = [];
      children = this.nodesOf(index, level, children, nodes[level]);
    }
    const starts = [];
    let at = 0;
    for (const level of nodes) starts.push(level.map((node) => (at += node.length) - node.length));
    const words = new Uint32Array(4 + at + leaves.length * (bricks ? 2 : 4));
    words.set([kTileMagic, this.level | levels << 8 | bricks << 16, at, leaves.length]);
    let to = 4;
    nodes.forEach((level, i) => level.forEach((node) => {
      words[to++] = node[0];
      for (let c = 1; c < node.length; ++c)
        words[to++] = i + 1 < levels ? starts[i + 1][node[c]] : node[c];
    }));
    for (const leaf of leaves) {
      if (!bricks) {
        words[to] = this.numbers[leaf];
        to += 2;
      }
      words[to++] = this.low[leaf];
      words[to++] = this.high[leaf];
    }
    return words;
  }

  // Adds the distinct leaves of a tile to `leaves`. A leaf is represented by its index in the
  // block. Returns a list with, for each leaf of the tile, its index in `leaves`.
  leavesOf(index, leaves) {
    const starts = this.starts[this.levels], {low, high, numbers} = this, indexes = [];
    for (let leaf = starts[index]; leaf < starts[index + 1]; ++leaf) {
      let known = leaves.findIndex(
          numbers ? (other) => numbers[other] === numbers[leaf] :
                    (other) => low[other] === low[leaf] && high[other] === high[leaf]);
      if (known < 0) known = leaves.push(leaf) - 1;
      indexes.push(known);
    }
    return indexes;
  }

  // Adds the distinct nodes on one level of a tile to `nodes`, as [mask, ...indexes of its
  // children]. `children` has these indexes for all nodes of the level. Returns a list with, for
  // each node of the level, its index in `nodes`.
  nodesOf(index, level, children, nodes) {
    const masks = this.masks[level], starts = this.starts[level], indexes = [];
    let from = 0;
    for (let at = starts[index]; at < starts[index + 1]; ++at) {
      const count = kPopcount[masks[at]], node = [masks[at], ...children.slice(from, from + count)];
      from += count;
      let known = nodes.findIndex(
          (other) => other.length === node.length && other.every((word, i) => word === node[i]));
      if (known < 0) known = nodes.push(node) - 1;
      indexes.push(known);
    }
    return indexes;
  }
}

function childStarts(masks, starts) {
  const children = new Uint32Array(starts.length);
  let at = 0, sum = 0;
  for (let tile = 0; tile + 1 < starts.length; ++tile) {
    for (; at < starts[tile + 1]; ++at) {
      if (masks[at] === 0) throw new Error("A block has a node without children.");
      sum += kPopcount[masks[at]];
    }
    children[tile + 1] = sum;
  }
  return children;
}

// Returns, for each leaf of a block, the number of the tile to which it refers. All leaves are
// cut-off nodes. A leaf either refers to the next new tile number, or has an old reference: a
// smaller number, which is stored. `next` is the first new number.
function readNumbers(columns, count, next) {
  const old = columns.take(Math.ceil(count / 8)), numbers = new Uint32Array(count);
  const isOld = (i) => old[i >>> 3] >>> (i & 7) & 1;
  for (let i = count; i < 8 * old.length; ++i) {
    if (isOld(i)) throw new Error("A block has a reference after its last leaf.");
  }
  for (let i = 0; i < count; ++i) {
    numbers[i] = isOld(i) ? columns.takeWord() : next++;
    if (numbers[i] >= next) throw new Error("A block refers to a tile that does not exist.");
  }
  return numbers;
}

// Returns the color pages of a block as a Map from the Morton code of the position of a page to the
// words of the page.
export function decodeColorBlock(bytes) {
  const words = new Uint32Array(bytes.slice().buffer, 0, bytes.length >>> 2), count = words[0];
  let at = 1 + 3 * count;
  if (bytes.length % 4 !== 0 || !(count > 0) || at > words.length)
    throw new Error("A block of color pages has a wrong length.");
  const pages = new Map();
  for (let i = 0; i < count; ++i) {
    const length = words[1 + 2 * count + i];
    if (length === 0 || at + length > words.length)
      throw new Error("A block of color pages ends too early.");
    pages.set(words[1 + i] + words[1 + count + i] * 2 ** 32, words.slice(at, at + length));
    at += length;
  }
  if (at !== words.length) throw new Error("A block of color pages has words after its pages.");
  return pages;
}

// Returns the Morton code of the position of a page. The code has up to 51 bits. JavaScript has
// exact integers of 53 bits, but shifts only of 32 bits, so the code is computed with
// multiplications.
export function mortonCode([x, y, z]) {
  let code = 0;
  for (let bit = 16; bit >= 0; --bit)
    code = 8 * code + 4 * (x >>> bit & 1) + 2 * (y >>> bit & 1) + (z >>> bit & 1);
  return code;
}

// Decompresses a gzip file. Resolves to the decompressed bytes. Rejects if the checksum in the file
// does not match them.
export async function gunzip(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
