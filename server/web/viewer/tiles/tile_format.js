// Decodes a tile (docs/format.md) and lays its words out for the pool. Tiles come from the network: every
// index is checked, so that a damaged tile is an error and never a wrong address on the GPU.

export const kBlockWords = 64;  // of the pool; a node or leaf never crosses the end of a block
export const kNodeWordsMax = 9;
const kMagic = 0x31544456;
const kHeadWords = 4;
const kCutWords = 4;  // of a cut-off node: in the tile and in the pool

export const kPopcount = Uint8Array.from({length: 256}, (_, i) => {
  let bits = 0;
  for (let rest = i; rest; rest &= rest - 1) ++bits;
  return bits;
});

// In the pool a node is as in the tile, with absolute addresses in place of indices. A brick is its two
// words. A cut-off node has: the slot of its tile (0: none), its coarse brick's two words, 0.
//
// Returns {level, levels, bricks, words, leaf_begin, leaf_count, addresses, coarse}: `words` are the
// pool's words at virtual addresses from 0 on, a multiple of kBlockWords; `pointers` are the positions
// in `words` of the addresses, which the pool makes absolute; `addresses` are the word offsets of the
// cut-off nodes in the file.
export function decode_tile(tile, expected_level) {
  const node_words = check_head(tile, expected_level);
  const levels = (tile[1] >>> 8) & 255, bricks = (tile[1] >>> 16 & 1) === 1;
  const leaf_count = tile[3];
  const nodes = tile.subarray(kHeadWords, kHeadWords + node_words);
  const place = new Uint32Array(node_words);  // virtual address of the node that begins here, plus 1
  const depth = new Uint8Array(node_words);
  const end = place_nodes(nodes, levels, place, depth);

  const leaf_words = bricks ? 2 : kCutWords;
  const leaf_begin = round_up(end, leaf_words);
  const total = round_up(leaf_begin + leaf_count * leaf_words, kBlockWords);
  const words = new Uint32Array(total);
  const pointers = new Uint32Array(node_words);
  let pointer_count = 0;
  for (let at = 0; at < node_words;) {
    const count = kPopcount[nodes[at]], to = place[at] - 1;
    words[to] = nodes[at];
    for (let child = 1; child <= count; ++child) {
      const index = nodes[at + child];
      const last = depth[at] === levels - 1;
      if (last && index >= leaf_count) throw new Error("A tile has a leaf index beyond its leaves.");
      words[to + child] = last ? leaf_begin + index * leaf_words : place[index] - 1;
      pointers[pointer_count++] = to + child;
    }
    at += 1 + count;
  }
  const addresses = copy_leaves(tile.subarray(kHeadWords + node_words), bricks, leaf_count, words, leaf_begin);
  return {level: tile[1] & 255, levels, bricks, words, pointers: pointers.subarray(0, pointer_count),
          leaf_begin, leaf_count, addresses};
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

// Packs the nodes in their order, none across the end of a block. Returns the address after the last.
function place_nodes(nodes, levels, place, depth) {
  let address = 0;
  for (let at = 0; at < nodes.length;) {
    const mask = nodes[at], count = kPopcount[mask & 255];
    if (mask === 0 || mask > 255 || at + count >= nodes.length)
      throw new Error(`A tile's node word ${at} is not a child mask.`);
    if (address % kBlockWords + 1 + count > kBlockWords) address = round_up(address, kBlockWords);
    place[at] = address + 1;
    address += 1 + count;
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
    words.set(leaves, begin);
    return null;
  }
  const addresses = new Float64Array(count);  // exact: offsets are below 2^40
  for (let i = 0; i < count; ++i) {
    const from = i * kCutWords;
    addresses[i] = leaves[from] + leaves[from + 1] * 2 ** 32;
    words[begin + from + 1] = leaves[from + 2];
    words[begin + from + 2] = leaves[from + 3];
  }
  return addresses;
}

function round_up(value, multiple) {
  return Math.ceil(value / multiple) * multiple;
}
