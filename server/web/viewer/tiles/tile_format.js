// Decodes a tile (docs/format.md) and lays its words out for the pool. Tiles come from the network: every
// index is checked, so that a damaged tile is an error and never a wrong address on the GPU.

export const kTexelWords = 4;
export const kBlockTexels = 16;  // of the pool; a node or leaf never crosses the end of a block
const kMagic = 0x31544456;
const kHeadWords = 4;
const kCutWords = 4;             // of a cut-off node in a tile

const kPopcount = Uint8Array.from({length: 256}, (_, i) => {
  let bits = 0;
  for (let rest = i; rest; rest &= rest - 1) ++bits;
  return bits;
});

// The pool has texels of four words, addressed by 24 bits. A *pointer* is the address of a texel times 256,
// plus the child mask of the node there; so a ray knows a node's mask without reading the node. A node is
// one pointer per child, in one or two texels. A cut-off node is one texel: the slot of its tile (0: none),
// its coarse brick's two words, 0. Two bricks share a texel; the pointer's lowest bit says which.
//
// Returns {level, levels, words, pointers, root, leaf_begin, addresses, coarse}: `words` are the pool's
// words at virtual addresses from 0 on, whole blocks; `pointers` are the positions in `words` of pointers
// with virtual addresses, which the pool makes absolute; `root` is such a pointer; `leaf_begin` is the first
// leaf's texel. `addresses` are the word offsets of the cut-off nodes in the file, and `coarse` their coarse
// bricks; both are null for a tile with bricks.
export function decode_tile(tile, expected_level) {
  const node_words = check_head(tile, expected_level);
  const levels = (tile[1] >>> 8) & 255, bricks = (tile[1] >>> 16 & 1) === 1;
  const leaf_count = tile[3];
  const nodes = tile.subarray(kHeadWords, kHeadWords + node_words);
  const place = new Uint32Array(node_words);  // pointer to the node that begins here
  const depth = new Uint8Array(node_words);
  const leaf_begin = place_nodes(nodes, levels, place, depth);
  const texels = leaf_begin + (bricks ? Math.ceil(leaf_count / 2) : leaf_count);
  const words = new Uint32Array(round_up(texels, kBlockTexels) * kTexelWords);
  const pointers = new Uint32Array(node_words);
  let pointer_count = 0;
  for (let at = 0; at < node_words;) {
    const count = kPopcount[nodes[at]], to = (place[at] >>> 8) * kTexelWords;
    for (let child = 0; child < count; ++child) {
      const index = nodes[at + 1 + child];
      if (depth[at] === levels - 1 && index >= leaf_count) throw new Error("A tile has a leaf index beyond its leaves.");
      words[to + child] = depth[at] < levels - 1 ? place[index]
        : bricks ? (leaf_begin + (index >>> 1)) * 256 + (index & 1) : (leaf_begin + index) * 256;
      pointers[pointer_count++] = to + child;
    }
    at += 1 + count;
  }
  const leaves = copy_leaves(tile.subarray(kHeadWords + node_words), bricks, leaf_count, words, leaf_begin);
  return {level: tile[1] & 255, levels, words, pointers: pointers.subarray(0, pointer_count), root: place[0], leaf_begin,
          ...leaves};
}

function check_head(tile, expected_level) {
  if (tile.length < kHeadWords + 2 || tile[0] !== kMagic) throw new Error("A tile does not begin as tiles do.");
  const levels = (tile[1] >>> 8) & 255, bricks = tile[1] >>> 16 & 1;
  if ((tile[1] & 255) !== expected_level || levels < 1)
    throw new Error(`A tile is of level ${tile[1] & 255}; expected ${expected_level}.`);
  const length = kHeadWords + tile[2] + tile[3] * (bricks ? 2 : kCutWords);
  if (tile[2] < 2 || length !== tile.length)
    throw new Error(`A tile has ${tile.length} words; its head says ${length}.`);
  return tile[2];
}

// Packs the nodes in their order, none across the end of a block. Returns the texel after the last.
function place_nodes(nodes, levels, place, depth) {
  let address = 0;
  for (let at = 0; at < nodes.length;) {
    const mask = nodes[at], count = kPopcount[mask & 255];
    if (mask === 0 || mask > 255 || at + count >= nodes.length)
      throw new Error(`A tile's node word ${at} is not a child mask.`);
    const texels = Math.ceil(count / kTexelWords);
    if (address % kBlockTexels + texels > kBlockTexels) address = round_up(address, kBlockTexels);
    place[at] = address * 256 + mask;
    address += texels;
    at += 1 + count;
  }
  // Children follow their parents, so one sweep finds every node's level.
  for (let at = 0; at < nodes.length;) {
    const count = kPopcount[nodes[at]];
    for (let child = 1; child <= count && depth[at] < levels - 1; ++child) {
      const index = nodes[at + child];
      if (index <= at || index >= nodes.length || place[index] === 0)
        throw new Error(`A tile's node word ${at + child} is not the index of a node after it.`);
      depth[index] = depth[at] + 1;
    }
    at += 1 + count;
  }
  return address;
}

function copy_leaves(leaves, bricks, count, words, begin) {
  if (bricks) {
    words.set(leaves, begin * kTexelWords);
    return {addresses: null, coarse: null};
  }
  const addresses = new Float64Array(count);  // exact: offsets are below 2^40
  const coarse = new Uint32Array(2 * count);
  for (let i = 0; i < count; ++i) {
    const from = i * kCutWords, to = (begin + i) * kTexelWords;
    addresses[i] = leaves[from] + leaves[from + 1] * 2 ** 32;
    words[to + 1] = coarse[2 * i] = leaves[from + 2];
    words[to + 2] = coarse[2 * i + 1] = leaves[from + 3];
  }
  return {addresses, coarse};
}

function round_up(value, multiple) {
  return Math.ceil(value / multiple) * multiple;
}
