// Fetches the tiles that a picture lacks.

import {TileError} from "../tile_source.js";
import {Loader} from "./loader.js";

const kMaxRequests = 4, kMaxBatch = 48;
const kFirstPauseMs = 300, kMaxPauseMs = 10000;

// Its requests are {key, level, offset, priority, leaves}: leaves are the texels of cut-off nodes to be linked.
export class TileLoader extends Loader {
  constructor(source, store, on_arrival) {
    super(store, on_arrival, {max_requests: kMaxRequests, max_batch: Math.min(kMaxBatch, source.batch_max)});
    this.source = source;
    this.first_view = null;      // the FirstView that the next tiles are shown to
  }

  // `wanted`: leaf address -> priority, of one reading of the feedback. Returns how many of the nodes
  // were linked to tiles that are there already.
  demand(wanted, now_ms) {
    const by_key = new Map();
    let linked = 0, unmet = 0;
    for (const [address, priority] of wanted) {
      const node = this.store.cut_off_node(address);
      if (!node) continue;
      if (this.store.tiles.has(node.key)) {
        linked += this.store.link(node);
        continue;
      }
      const request = this.loading.get(node.key) || by_key.get(node.key);
      if (request) {
        unmet++;
        request.leaves.add(address);
        request.priority += priority;
      } else if (this.is_refused(node.key)) {
        continue;
      } else if (!this.may_ask(node.key, now_ms)) {
        unmet++;
      } else {
        unmet++;
        by_key.set(node.key, {key: node.key, level: node.level, offset: node.offset, priority, leaves: new Set([address])});
      }
    }
    this.replace_queue([...by_key.values()], unmet, now_ms);
    return linked;
  }

  // Loads one tile that no other refers to. Resolves to its words, undefined after dispose().
  async load_root(level, offset) {
    for (let pause_ms = kFirstPauseMs; ; pause_ms = Math.min(2 * pause_ms, kMaxPauseMs)) {
      try {
        const [words] = await this.source.fetchTiles([{level, offset}]);
        if (this.disposed) return;
        if (!this.store.add(level, offset, words, performance.now()))
          throw new Error("The budget is too small for a single tile.");
        this.store.set_root(level, offset);
        return words;
      } catch (error) {
        if (!(error instanceof TileError && error.is_transient)) throw error;
        await new Promise((resolve) => setTimeout(resolve, pause_ms));
        if (this.disposed) return;
      }
    }
  }

  fetch_all(batch) {
    return this.source.fetchTiles(batch);
  }

  keep(request, words, now_ms) {
    if (!this.store.add(request.level, request.offset, words, now_ms)) return false;
    for (const address of request.leaves) {
      const node = this.store.cut_off_node(address);
      if (node?.key === request.key) this.store.link(node);
    }
    this.first_view?.take(this.store, this.store.get(request.level, request.offset), words);
    return true;
  }
}
