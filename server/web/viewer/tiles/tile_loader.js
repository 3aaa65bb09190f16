// Fetches the tiles that a picture lacks.

import {TileError} from "../tile_source.js";
import {Loader, pause_after} from "./loader.js";

const kMaxRequests = 4, kMaxBatch = 48;
const kMaxRootTries = 3;       // while the root's answers make no sense

// Its requests are {key, level, offset, priority, leaves}: leaves are the texels of cut-off nodes to be linked.
export class TileLoader extends Loader {
  constructor(source, store, on_arrival) {
    super(source, store, on_arrival, {max_requests: kMaxRequests, max_batch: Math.min(kMaxBatch, source.batch_max)});
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
      } else if (this.is_refused(node.key, now_ms)) {
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
    const {signal} = this.ending;
    for (let tries = 1; ; ++tries) {
      let words = null;
      try {
        [words] = await this.source.fetchTiles([{level, offset}], {signal, cache: tries > 1 ? "reload" : undefined});
        if (this.disposed) return;
        if (!this.store.add(level, offset, words, performance.now())) words = null;
      } catch (error) {
        if (error.is_missing && !this.disposed) await this.source.look_again(signal);
        if (this.disposed) return;
        const is_known = error instanceof TileError && error.status !== 200;
        if (is_known ? !error.is_transient : tries >= kMaxRootTries) throw error;
        if (!error.is_busy) this.trouble = {code: "unreachable", message: error.message};
        await new Promise((resolve) => setTimeout(resolve, pause_after(tries) + (error.retry_after_ms || 0)));
        if (this.disposed) return;
        continue;
      }
      if (!words) throw new Error("The budget is too small for a single tile.");
      this.end_outage();
      this.store.set_root(level, offset);
      this.link_root();
      return words;
    }
  }

  // What lies below another root already is seen at once, not only when a reading has asked for it.
  link_root() {
    const {store} = this, {root} = store;
    for (let i = 0; i < (root.addresses?.length ?? 0); ++i) {
      const node = store.leaf(root, i);
      if (store.tiles.has(node.key)) store.link(node);
    }
  }

  name_of({level, offset}) {
    return `tile ${level}/${offset}`;
  }

  fetch_all(batch, options) {
    return this.source.fetchTiles(batch, options);
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
