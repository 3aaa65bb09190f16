// Fetches the tiles that a picture needs but that are not loaded.

import {TileError} from "../tile_source.js";

import {Loader, pauseAfter} from "./loader.js";

const kMaxRequests = 4, kMaxBatch = 48;
const kMaxRootTries = 3;  // tries to load the root if the answers are unusable

// A request is {key, level, offset, priority, leaves}; `leaves` are the texels of the cut-off nodes
// that must be linked to the tile.
export class TileLoader extends Loader {
  constructor(source, store, onArrival) {
    const {tileLimits, batchMax} = source;
    super(
        source, store, onArrival,
        tileLimits ?? {maxRequests: kMaxRequests, maxBatch: Math.min(kMaxBatch, batchMax)});
    this.firstView = null;  // the FirstView that receives the next tiles
  }

  // Requests the tiles of one reading. `wanted` maps the texels of cut-off nodes to priorities.
  // Returns the number of cut-off nodes that were linked to already loaded tiles.
  demand(wanted, nowMs) {
    const byKey = new Map();
    let linked = 0, unmet = 0;
    for (const [address, priority] of wanted) {
      const node = this.store.cutOffNode(address);
      if (!node) continue;
      if (this.store.tiles.has(node.key)) {
        linked += this.store.link(node);
        continue;
      }
      const request = this.loading.get(node.key) || byKey.get(node.key);
      if (request) {
        unmet++;
        request.leaves.add(address);
        request.priority += priority;
      } else if (this.isRefused(node.key, nowMs)) {
        continue;
      } else if (!this.mayAsk(node.key, nowMs)) {
        unmet++;
      } else {
        unmet++;
        byKey.set(node.key, {
          key: node.key,
          level: node.level,
          offset: node.offset,
          priority,
          leaves: new Set([address])
        });
      }
    }
    this.replaceQueue([...byKey.values()], unmet, nowMs);
    return linked;
  }

  // Loads the root, to which no other tile refers. Resolves to its words; to undefined after
  // dispose().
  async loadRoot(level, offset) {
    const {signal} = this.ending;
    for (let tries = 1;; ++tries) {
      let words = null;
      try {
        [words] = await this.source.fetchTiles(
            [{level, offset}], {signal, cache: tries > 1 ? "reload" : undefined});
        if (this.disposed) return;
        if (words instanceof Error) throw words;
        if (!this.store.add(level, offset, words, performance.now())) words = null;
      } catch (error) {
        if (error.isMissing && !this.disposed) await this.source.lookAgain(signal);
        if (this.disposed) return;
        const isKnown = error instanceof TileError && error.status !== 200;
        if (isKnown ? !error.isTransient : tries >= kMaxRootTries) throw error;
        if (!error.isBusy) this.trouble = {code: "unreachable", message: error.message};
        await new Promise(
            (resolve) => setTimeout(resolve, pauseAfter(tries) + (error.retryAfterMs || 0)));
        if (this.disposed) return;
        continue;
      }
      if (!words) throw new Error("The budget is too small for a single tile.");
      this.endOutage();
      this.store.setRoot(level, offset);
      this.linkRoot();
      return words;
    }
  }

  // Links a new root to the already loaded tiles below it, without waiting for a reading.
  linkRoot() {
    const {store} = this, {root} = store;
    for (let i = 0; i < (root.addresses?.length ?? 0); ++i) {
      const node = store.leaf(root, i);
      if (store.tiles.has(node.key)) store.link(node);
    }
  }

  nameOf({level, offset}) {
    return `tile ${level}/${offset}`;
  }

  fetchAll(batch, options) {
    return this.source.fetchTiles(batch, options);
  }

  keep(request, words, nowMs) {
    if (!this.store.add(request.level, request.offset, words, nowMs)) return false;
    for (const address of request.leaves) {
      const node = this.store.cutOffNode(address);
      if (node?.key === request.key) this.store.link(node);
    }
    this.firstView?.take(this.store, this.store.get(request.level, request.offset), words);
    return true;
  }
}
