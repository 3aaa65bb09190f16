// The loaded tiles, by their root nodes, and the eviction of tiles when the pool is full.
//
// Tiles refer to each other by slots. A cut-off node in the pool contains the slot of its tile. The
// pool's table contains the pointer to the slot's tile, or 0 if the tile is not loaded. So equal
// subtrees share one tile, and an eviction costs one write. A slot exists while its tile is loaded
// or a loaded tile refers to it.
//
// An *epoch* is the time in which the view remains the same. A tile is evicted only if the pictures
// of the current epoch do not use it and, while the camera moves, only if it was not used recently.
// Tiles loaded for a view remain until the next view. So the number of tiles fetched for one view
// is bounded, however small the pool is.

import {kRoundsToKnow} from "./loader.js";
import {decodeTile, kBlockTexels, kTexelWords, tileShape} from "./tile_format.js";

// In the first kRoundsToKnow readings of a view, tiles that were used within this time are not
// evicted, because the view possibly still uses them.
const kRecentMs = 1500;
const kBlockBytes = kBlockTexels * kTexelWords * 4;
const kFreeShare = 1 / 64;  // share of the pool that an eviction frees beyond the need

// Returns a unique number for a node. Offsets are below 2^40.
export function keyOf(level, offset) {
  return offset * 32 + level;
}

export class TileStore {
  // `info`: the manifest of the file.
  constructor(pool, info) {
    this.pool = pool;
    this.info = info;
    this.tiles = new Map();  // key -> tile
    this.slots = new Map();  // key -> slot
    this.owner = [];         // block -> tile
    this.ordinal = [];       // block -> its number within the tile
    this.bySlot = [];        // slot -> {key, tile (null if it is not loaded), references}
    this.root = null;
    this.tileBytes = 0;
    this.epoch = 0;
    this.rounds = 0;  // number of feedback readings in this epoch
    this.evicted = 0;
  }

  beginEpoch() {
    this.epoch++;
    this.rounds = 0;
  }

  get(level, offset) {
    return this.tiles.get(keyOf(level, offset));
  }

  // Returns the cut-off node {tile, index, level, offset, key, texel} at a texel of the pool; null
  // without one.
  cutOffNode(texel) {
    const block = Math.floor(texel / kBlockTexels), tile = this.owner[block];
    if (!tile || !tile.addresses) return null;
    const index = this.ordinal[block] * kBlockTexels + texel % kBlockTexels - tile.leafBegin;
    if (index < 0 || index >= tile.addresses.length) return null;
    const level = tile.level + tile.levels, offset = tile.addresses[index];
    return {tile, index, level, offset, key: keyOf(level, offset), texel};
  }

  // Returns the cut-off node with this index in `tile`, in the form of cutOffNode().
  leaf(tile, index) {
    const at = tile.leafBegin + index;
    return this.cutOffNode(
        tile.blocks[Math.floor(at / kBlockTexels)] * kBlockTexels + at % kBlockTexels);
  }

  // Makes a cut-off node refer to its tile, which must be loaded.
  link(node) {
    const slot = this.slots.get(node.key);
    if (node.tile.links.has(node.index) || slot === undefined) return false;
    node.tile.links.set(node.index, slot);
    this.bySlot[slot].references++;
    const {coarse} = node.tile;
    this.pool.write(
        node.texel, Uint32Array.of(slot, coarse[2 * node.index], coarse[2 * node.index + 1], 0));
    return true;
  }

  // Stores a fetched tile. Returns false if the pool is full and the view needs all tiles in the
  // pool. Throws if the fetched tile is damaged.
  add(level, offset, words, nowMs) {
    const key = keyOf(level, offset);
    if (this.tiles.has(key)) return true;
    const decoded = decodeTile(words, level, tileShape(this.info, level));
    const count = decoded.words.length * 4 / kBlockBytes;
    if (!this.evictFor(count, !this.slots.has(key), nowMs)) return false;
    const blocks = this.pool.allocate(count);
    if (!blocks) return false;
    const slot = this.slots.get(key) ?? this.pool.allocateSlot();
    const tile = {
      key,
      level,
      offset,
      levels: decoded.levels,
      slot,
      blocks,
      leafBegin: decoded.leafBegin,
      addresses: decoded.addresses,
      coarse: decoded.coarse,
      links: new Map(),
      usedMs: nowMs,
      epoch: this.epoch,
      pointer: 0
    };
    tile.pointer = this.pool.upload(blocks, decoded);
    blocks.forEach((block, i) => {
      this.owner[block] = tile;
      this.ordinal[block] = i;
    });
    this.pool.setSlot(slot, tile.pointer);
    this.slots.set(key, slot);
    this.bySlot[slot] ??= {key, tile: null, references: 0};
    this.bySlot[slot].tile = tile;
    this.tiles.set(key, tile);
    this.tileBytes += count * kBlockBytes;
    return true;
  }

  setRoot(level, offset) {
    this.root = this.get(level, offset);
  }

  // Stores the only brick of a grid of 4^3 voxels, which is two words. Returns the pointer to the
  // brick.
  addBrick(brick) {
    const words = new Uint32Array(kBlockTexels * kTexelWords);
    words.set(brick);
    const blocks = this.pool.allocate(1);
    if (!blocks) throw new Error("The GPU has no memory for a single brick.");
    return this.pool.upload(blocks, {words, pointers: [], root: 0});
  }

  // Marks the tile in a slot as used by a picture that was drawn for `epoch`.
  mark(slot, epoch, nowMs) {
    const tile = this.bySlot[slot]?.tile;
    if (!tile) return;
    tile.usedMs = nowMs;
    if (epoch > tile.epoch) tile.epoch = epoch;
  }

  // Evicts tiles until `count` blocks are free and, if `needsSlot`, also a slot. An evicted tile
  // keeps its slot while other tiles refer to it, so evictions continue until a slot is free.
  // Returns false if not enough can be evicted.
  evictFor(count, needsSlot, nowMs) {
    const fits = (blocks) =>
        this.pool.freeBlocks >= blocks && (!needsSlot || this.pool.hasFreeSlot);
    if (fits(count)) return true;
    const maxUsedMs = nowMs - (this.rounds >= kRoundsToKnow ? 0 : kRecentMs);
    const candidates = [];
    for (const tile of this.tiles.values())
      if (tile !== this.root && tile.epoch !== this.epoch && tile.usedMs < maxUsedMs)
        candidates.push(tile);
    candidates.sort((a, b) => a.usedMs - b.usedMs);
    const target = count + this.pool.blockCount * kFreeShare;
    for (const tile of candidates) {
      if (fits(target)) break;
      this.evict(tile);
    }
    return fits(count);
  }

  evict(tile) {
    this.evicted++;
    this.tileBytes -= tile.blocks.length * kBlockBytes;
    this.tiles.delete(tile.key);
    for (const block of tile.blocks) this.owner[block] = undefined;
    this.pool.release(tile.blocks);
    this.pool.setSlot(tile.slot, 0);
    this.bySlot[tile.slot].tile = null;
    this.releaseIfUnused(tile.slot);
    for (const slot of tile.links.values()) {
      this.bySlot[slot].references--;
      this.releaseIfUnused(slot);
    }
  }

  releaseIfUnused(slot) {
    const entry = this.bySlot[slot];
    if (!entry || entry.tile || entry.references > 0) return;
    this.bySlot[slot] = undefined;
    this.slots.delete(entry.key);
    this.pool.releaseSlot(slot);
  }
}
