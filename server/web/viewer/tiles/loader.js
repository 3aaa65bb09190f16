// What decides what is fetched next, and survives what fails: for tiles and for color pages. Each reading
// of the feedback replaces the queue, so that what has left the picture is not fetched any more.

import {TileError} from "../tile_source.js";

export const kRoundsToKnow = 4;  // readings of the feedback after which what was not seen is known to be so
const kFirstPauseMs = 300, kMaxPauseMs = 10000;
const kMaxRefusals = 3;        // of one item, after which it is not asked for again
const kFullPauseMs = 250;

// A request is {key, priority, ...}. Derived classes have
//     async fetch_all(batch)        resolves to the answers, in the order of the requests
//     keep(request, answer, now_ms) false if there is no room; throws if the answer is damaged
// and `store.rounds`, the readings since the view changed.
export class Loader {
  // on_arrival(failed): something arrived, or, if `failed`, what fails changed.
  constructor(store, on_arrival, {max_requests, max_batch}) {
    this.store = store;
    this.on_arrival = on_arrival;
    this.max_requests = max_requests;  // at the same time
    this.max_batch = max_batch;
    this.queue = [];
    this.loading = new Map();    // key -> request
    this.failures = new Map();   // key -> {count, retry_ms, alone}
    this.requests = 0;
    this.failed_total = 0;
    this.requested_total = 0;
    this.outage = {count: 0, retry_ms: 0};
    this.full_until_ms = 0;      // Infinity: until the next epoch
    this.problem = null;
    this.timer = 0;
    this.unmet = 0;              // what the last reading wanted and may still come
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

  // Whether it was refused so often that it is not asked for any more.
  is_refused(key) {
    return this.failures.get(key)?.count >= kMaxRefusals;
  }

  may_ask(key, now_ms) {
    const failure = this.failures.get(key);
    if (failure && (failure.count >= kMaxRefusals || now_ms < failure.retry_ms)) return false;
    return now_ms >= this.full_until_ms;
  }

  // `requests` are those of one reading, of which `unmet` may still come.
  replace_queue(requests, unmet, now_ms) {
    this.unmet = unmet;
    if (unmet === 0) this.end_outage();
    this.queue = requests.sort((a, b) => a.priority - b.priority);
    this.send(now_ms);
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
    const max_requests = this.outage.count > 0 ? 1 : this.max_requests;
    while (this.requests < max_requests && this.queue.length > 0 && !this.is_full) {
      const batch = [this.queue.pop()];
      const alone = (request) => this.failures.get(request.key)?.alone;
      while (!alone(batch[0]) && batch.length < this.max_batch && this.queue.length > 0 && !alone(this.queue.at(-1)))
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
      answer = await this.fetch_all(batch);
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
    this.on_arrival(answer === null);
  }

  end_outage() {
    this.outage = {count: 0, retry_ms: 0};
    if (this.problem?.code !== "replaced") this.problem = null;
  }

  accept(batch, answer, now_ms) {
    this.end_outage();
    let has_room = true;
    batch.forEach((request, i) => {
      if (!has_room) return;
      try {
        if (this.keep(request, answer[i], now_ms)) {
          this.failures.delete(request.key);
        } else {
          has_room = false;
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
      console.warn(`voxdag: a request was refused: ${message}`);
    }
    this.failures.set(key, failure);
  }

  pause(now_ms) {
    this.failed_total++;
    this.outage.count++;
    this.outage.retry_ms = now_ms + Math.min(kMaxPauseMs, kFirstPauseMs * 2 ** (this.outage.count - 1));
    this.wake_at(this.outage.retry_ms, now_ms);
  }

  // Whether something wanted may still arrive though no request is under way.
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
      this.on_arrival(true);
    }, Math.max(0, time_ms - now_ms) + 1);
  }

  dispose() {
    this.disposed = true;
    clearTimeout(this.timer);
  }
}
