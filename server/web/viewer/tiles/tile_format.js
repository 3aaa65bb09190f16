// Decodes a tile (docs/format.md) and lays out its words for the pool. Tiles come from the network.
// Every index is checked, so a damaged tile is an error and never leads to a wrong address on the
// GPU.

export const kTexelWords = 4;
export const kBlockTexels = 16;  // texels per pool block; no node or leaf crosses a block's end
const kMagic = 0x31544456;
const kHeadWords = 4;
const kCutWords = 4;  // words of a cut-off node in a tile
const kMaxOffset = 2 ** 40 - 1;

const kPopcount = Uint8Array.from({length: 256}, (_, i) => {
  let bits = 0;
  for (let rest = i; rest; rest &= rest - 1) ++bits;
  return bits;
});

// The pool has texels of four words, addressed by 24 bits. A *pointer* is the address of a texel
// times 256, plus the child mask of the node there, so a ray knows a node's mask before it reads
// the node. A node is one pointer per child, in one or two texels. A *cut-off node* is a node at
// which a tile ends above the bricks; it is the root of another tile. Its texel has the slot of
// that tile (0: none), the two words of a coarse brick, and 0. Two bricks share a texel; the lowest
// bit of the pointer selects one of them.
//
// `shape` is the tileShape() of the level. Returns {level, levels, words, pointers, root,
// leafBegin, addresses, coarse}. `words` are the words of complete blocks for the pool. Their
// virtual addresses are the numbers of their texels, from 0. `pointers` are the positions in
// `words` of pointers with virtual addresses, which the pool replaces with absolute addresses;
// `root` is also a pointer with a virtual address. `leafBegin` is the texel of the first leaf.
// `addresses` are the word offsets of the cut-off nodes in the file, and `coarse` their coarse
// bricks; both are null for a tile with bricks.
export function decodeTile(tile, level, shape) {
  checkHead(tile, level, shape);
  const {levels, bricks} = shape, nodeWords = tile[2], leafCount = tile[3];
  const nodes = tile.subarray(kHeadWords, kHeadWords + nodeWords);
  const place = new Uint32Array(nodeWords);  // at each word that begins a node: pointer to the node
  const depth = new Uint8Array(nodeWords);
  const leafBegin = placeNodes(nodes, levels, place, depth);
  const texels = leafBegin + (bricks ? Math.ceil(leafCount / 2) : leafCount);
  const words = new Uint32Array(roundUp(texels, kBlockTexels) * kTexelWords);
  const pointers = new Uint32Array(nodeWords);
  let pointerCount = 0;
  for (let at = 0; at < nodeWords;) {
    const count = kPopcount[nodes[at]], to = (place[at] >>> 8) * kTexelWords;
    for (let child = 0; child < count; ++child) {
      const index = nodes[at + 1 + child];
      if (depth[at] === levels - 1 && index >= leafCount)
        throw new Error(`A tile has the leaf index ${index}; expected less than ${leafCount}.`);
      words[to + child] = depth[at] < levels - 1 ? place[index] :
          bricks                                 ? (leafBegin + (index >>> 1)) * 256 + (index & 1) :
                                                   (leafBegin + index) * 256;
      pointers[pointerCount++] = to + child;
    }
    at += 1 + count;
  }
  const leaves =
      copyLeaves(tile.subarray(kHeadWords + nodeWords), bricks, leafCount, words, leafBegin);
  return {
    level,
    levels,
    words,
    pointers: pointers.subarray(0, pointerCount),
    root: place[0],
    leafBegin,
    ...leaves
  };
}

// Returns the shape of a tile at `level`, for a file with this manifest: the number of the tile's
// levels, and whether its leaves are bricks.
export function tileShape({levels, tile_levels}, level) {
  const below = levels - 2 - level, own = (below - 1) % tile_levels + 1;
  return {levels: own, bricks: own === below};
}

function checkHead(tile, level, {levels, bricks}) {
  if (tile.length < kHeadWords + 2 || tile[0] !== kMagic)
    throw new Error(
        `A tile has ${tile.length} words and begins with ${tile[0]?.toString(16)}; expected ${
            kHeadWords + 2} or more words and ${kMagic.toString(16)}.`);
  const shape = level | levels << 8 | bricks << 16;
  if (tile[1] !== shape)
    throw new Error(
        `A tile has the shape ${tile[1].toString(16)}; expected ${shape.toString(16)}.`);
  const length = kHeadWords + tile[2] + tile[3] * (bricks ? 2 : kCutWords);
  if (tile[2] < 2 || length !== tile.length)
    throw new Error(`A tile has ${tile.length} words; expected ${length} by its head.`);
  if (tile[3] > 8 ** levels)
    throw new Error(`A tile has ${tile[3]} leaves; expected ${8 ** levels} at most.`);
}

// Places the nodes in order, so that no node crosses the end of a block. Returns the texel after
// the last node.
function placeNodes(nodes, levels, place, depth) {
  let address = 0;
  for (let at = 0; at < nodes.length;) {
    const mask = nodes[at], count = kPopcount[mask & 255];
    if (mask === 0 || mask > 255 || at + count >= nodes.length)
      throw new Error(`A tile's node word ${at} is not a child mask.`);
    const texels = Math.ceil(count / kTexelWords);
    if (address % kBlockTexels + texels > kBlockTexels) address = roundUp(address, kBlockTexels);
    place[at] = address * 256 + mask;
    address += texels;
    at += 1 + count;
  }
  // Children follow their parents, so one pass over the words finds the level of every node.
  for (let at = 0; at < nodes.length;) {
    const count = kPopcount[nodes[at]];
    if (at > 0 && depth[at] === 0)
      throw new Error(`A tile's node word ${at} begins a node that is the child of no node.`);
    for (let child = 1; child <= count && depth[at] < levels - 1; ++child) {
      const index = nodes[at + child];
      if (index <= at || index >= nodes.length || place[index] === 0)
        throw new Error(`A tile's node word ${at + child} is not the index of a node after it.`);
      if (depth[index] !== 0 && depth[index] !== depth[at] + 1)
        throw new Error(`A tile's node word ${at + child} names a node of the wrong level.`);
      depth[index] = depth[at] + 1;
    }
    at += 1 + count;
  }
  return address;
}

function copyLeaves(leaves, bricks, count, words, begin) {
  const expectSome = (low, high, leaf) => {
    if (low === 0 && high === 0) throw new Error(`A tile's leaf ${leaf} has nothing to draw.`);
  };
  if (bricks) {
    for (let i = 0; i < count; ++i) expectSome(leaves[2 * i], leaves[2 * i + 1], i);
    words.set(leaves, begin * kTexelWords);
    return {addresses: null, coarse: null};
  }
  const addresses = new Float64Array(count);  // exact: they are below 2^40
  const coarse = new Uint32Array(2 * count);
  for (let i = 0; i < count; ++i) {
    const from = i * kCutWords, to = (begin + i) * kTexelWords;
    addresses[i] = leaves[from] + leaves[from + 1] * 2 ** 32;
    words[to + 1] = coarse[2 * i] = leaves[from + 2];
    words[to + 2] = coarse[2 * i + 1] = leaves[from + 3];
    if (addresses[i] > kMaxOffset)
      throw new Error(`A tile's leaf ${i} has the word offset ${addresses[i]}; expected ${
          kMaxOffset} at most.`);
    expectSome(coarse[2 * i], coarse[2 * i + 1], i);
  }
  return {addresses, coarse};
}

function roundUp(value, multiple) {
  return Math.ceil(value / multiple) * multiple;
}
