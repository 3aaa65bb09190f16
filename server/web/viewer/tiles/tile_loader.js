// Decides what is fetched next, and survives what fails. Each reading of the feedback replaces the queue,
// so that what has left the picture is not fetched any more.

import {TileError} from "../tile_source.js";
import {kRoundsToKnow} from "./tile_store.js";

const kMaxRequests = 4;        // at the same time
const kMaxBatch = 48;
const kFirstPauseMs = 300, kMaxPauseMs = 10000;
const kMaxRefusals = 3;        // of one tile, after which it is not asked for again
const kFullPauseMs = 250;

export class TileLoader {
  // on_arrival(): tiles arrived, or what fails changed.
  constructor(source, store, on_arrival) {
    this.source = source;
    this.store = store;
    this.on_arrival = on_arrival;
    this.queue = [];
    this.loading = new Map();    // key -> request {key, level, offset, leaves}
    this.failures = new Map();   // key -> {count, retry_ms, alone}
    this.requests = 0;
    this.failed_total = 0;
    this.requested_total = 0;
    this.outage = {count: 0, retry_ms: 0};
    this.full_until_ms = 0;      // Infinity: until the next epoch
    this.problem = null;
    this.timer = 0;
    this.unmet = 0;              // wanted nodes of the last reading whose tiles may still come
    this.disposed = false;
  }

  // True if nothing more will arrive for the view, unless it changes.
  get is_idle() {
    return this.requests === 0 && this.queue.length === 0;
  }
  get is_full() {
    return performance.now() < this.full_until_ms;
  }

  begin_epoch() {
    if (this.full_until_ms === Infinity) this.full_until_ms = 0;
  }

  // `wanted`: leaf address -> priority, of one reading of the feedback. Returns how many of the nodes
  // were linked to tiles that are there already.
  demand(wanted, now_ms) {
    const by_key = new Map();
    let linked = 0;
    this.unmet = 0;
    for (const [address, priority] of wanted) {
      const node = this.store.cut_off_node(address);
      if (!node) continue;
      if (this.store.tiles.has(node.key)) {
        linked += this.store.link(node);
        continue;
      }
      const request = this.loading.get(node.key) || by_key.get(node.key);
      if (request) {
        this.unmet++;
        request.leaves.add(address);
        request.priority += priority;
      } else if (this.failures.get(node.key)?.count >= kMaxRefusals) {
        continue;
      } else if (!this.may_ask(node.key, now_ms)) {
        this.unmet++;
      } else {
        this.unmet++;
        by_key.set(node.key, {key: node.key, level: node.level, offset: node.offset, priority, leaves: new Set([address])});
      }
    }
    if (this.unmet === 0) this.end_outage();
    this.queue = [...by_key.values()].sort((a, b) => a.priority - b.priority);
    this.send(now_ms);
    return linked;
  }

  may_ask(key, now_ms) {
    const failure = this.failures.get(key);
    if (failure && (failure.count >= kMaxRefusals || now_ms < failure.retry_ms)) return false;
    return now_ms >= this.full_until_ms;
  }

  // Loads one tile that no other refers to.
  async load_root(level, offset) {
    for (let pause_ms = kFirstPauseMs; ; pause_ms = Math.min(2 * pause_ms, kMaxPauseMs)) {
      try {
        const [words] = await this.source.fetchTiles([{level, offset}]);
        if (this.disposed) return;
        if (!this.store.add(level, offset, words, performance.now()))
          throw new Error("The budget is too small for a single tile.");
        this.store.set_root(level, offset);
        return;
      } catch (error) {
        if (!(error instanceof TileError && error.is_transient)) throw error;
        await new Promise((resolve) => setTimeout(resolve, pause_ms));
        if (this.disposed) return;
      }
    }
  }

  send(now_ms) {
    if (this.problem?.code === "replaced" || this.disposed) {
      this.queue = [];
      return;
    }
    if (now_ms < this.outage.retry_ms) {
      this.wake_at(this.outage.retry_ms, now_ms);
      return;
    }
    // After an outage one request tries whether it is over.
    const max_requests = this.outage.count > 0 ? 1 : kMaxRequests;
    const max_batch = Math.min(kMaxBatch, this.source.batch_max);
    while (this.requests < max_requests && this.queue.length > 0 && !this.is_full) {
      const batch = [this.queue.pop()];
      const alone = (request) => this.failures.get(request.key)?.alone;
      while (!alone(batch[0]) && batch.length < max_batch && this.queue.length > 0 && !alone(this.queue.at(-1)))
        batch.push(this.queue.pop());
      this.fetch(batch);
    }
  }

  async fetch(batch) {
    this.requests++;
    this.requested_total += batch.length;
    for (const request of batch) this.loading.set(request.key, request);
    let answer = null, error = null;
    try {
      answer = await this.source.fetchTiles(batch);
    } catch (caught) {
      error = caught;
    }
    this.requests--;
    for (const request of batch) this.loading.delete(request.key);
    if (this.disposed) return;
    const now_ms = performance.now();
    if (answer) this.accept(batch, answer, now_ms);
    else this.refuse(batch, error, now_ms);
    this.send(now_ms);
    this.on_arrival();
  }

  end_outage() {
    this.outage = {count: 0, retry_ms: 0};
    if (this.problem?.code !== "replaced") this.problem = null;
  }

  accept(batch, answer, now_ms) {
    this.end_outage();
    batch.forEach((request, i) => {
      try {
        if (this.store.add(request.level, request.offset, answer[i], now_ms)) {
          this.failures.delete(request.key);
          for (const address of request.leaves) this.link(address, request.key);
        } else {
          // When the store knows what the view does not need, all that is left is needed.
          this.full_until_ms = this.store.rounds >= kRoundsToKnow ? Infinity : now_ms + kFullPauseMs;
          this.queue = [];
          this.wake_at(now_ms + kFullPauseMs, now_ms);
        }
      } catch (error) {
        this.note_failure(request.key, true, now_ms, error.message);
      }
    });
  }

  link(address, key) {
    const node = this.store.cut_off_node(address);
    if (node?.key === key) this.store.link(node);
  }

  refuse(batch, error, now_ms) {
    const status = error instanceof TileError ? error.status : 200;
    if (status === 410) {
      this.problem = {code: "replaced", message: "The file was replaced while it was being viewed. Load the page again."};
      this.queue = [];
    } else if (status === 401 || status === 403) {
      this.problem = {code: "unauthorized", message: error.message};
      this.pause(now_ms);
    } else if (!(error instanceof TileError) || !error.is_transient) {
      // One of them is at fault: each is asked for alone.
      for (const {key} of batch) this.note_failure(key, batch.length === 1, now_ms, error.message);
    } else {
      this.problem = {code: "unreachable", message: error.message};
      this.pause(now_ms);
    }
  }

  note_failure(key, counts, now_ms, message) {
    const failure = this.failures.get(key) || {count: 0, retry_ms: 0, alone: true};
    if (counts) {
      failure.count++;
      failure.retry_ms = now_ms + kFirstPauseMs * 2 ** failure.count;
      this.wake_at(failure.retry_ms, now_ms);
      this.failed_total++;
      console.warn(`voxdag: a tile was refused: ${message}`);
    }
    this.failures.set(key, failure);
  }

  pause(now_ms) {
    this.failed_total++;
    this.outage.count++;
    this.outage.retry_ms = now_ms + Math.min(kMaxPauseMs, kFirstPauseMs * 2 ** (this.outage.count - 1));
    this.wake_at(this.outage.retry_ms, now_ms);
  }

  // Whether a wanted tile may still arrive though no request is under way.
  get awaits_retry() {
    const now_ms = performance.now();
    if (this.problem?.code === "replaced" || this.unmet === 0) return false;
    return this.outage.count > 0 || (now_ms < this.full_until_ms && this.full_until_ms !== Infinity) ||
           [...this.failures.values()].some((f) => f.count > 0 && f.count < kMaxRefusals && now_ms < f.retry_ms);
  }

  // Whether nothing is asked for until a time that wakes the renderer.
  pauses(now_ms) {
    return this.requests === 0 && now_ms < this.outage.retry_ms;
  }

  wake_at(time_ms, now_ms) {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      this.send(performance.now());
      this.on_arrival();
    }, Math.max(0, time_ms - now_ms) + 1);
  }

  dispose() {
    this.disposed = true;
    clearTimeout(this.timer);
  }
}
