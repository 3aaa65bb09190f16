// What decides what is fetched next, and survives what fails: for tiles and for color pages. Each reading
// of the feedback replaces the queue, so that what has left the picture is not fetched any more.

import {TileError} from "../tile_source.js";

export const kRoundsToKnow = 4;  // readings of the feedback after which what was not seen is known to be so
const kFirstPauseMs = 300, kMaxPauseMs = 10000, kMaxBusyMs = 60000;
const kMaxTries = 3;           // of one item whose answers are of no use
const kRefusedMs = 300000;     // until an item that was refused is asked for again
const kMaxFailures = 65536;    // that are remembered
const kMaxWarnings = 20;
const kFullPauseMs = 250;

const kDamaged = {code: "damaged", message: "Part of the file is damaged and drawn coarse: run voxdag verify."};
const kRefused = {code: "refused", message: "Part of the file is drawn coarse: the service fails to send it."};

// Random, so that those who lost the same service do not come back at the same time.
export function pause_after(failures) {
  return Math.min(kMaxPauseMs, kFirstPauseMs * 2 ** (failures - 1)) * (0.5 + 0.5 * Math.random());
}

// A request is {key, priority, ...}. Derived classes have
//     async fetch_all(batch, options) resolves to the answers, in the order of the requests
//     keep(request, answer, now_ms) false if there is no room; throws if the answer is damaged
//     name_of(request)              for messages
// and `store.rounds`, the readings since the view changed.
export class Loader {
  // on_arrival(failed): something arrived, or, if `failed`, what fails changed.
  constructor(source, store, on_arrival, {max_requests, max_batch}) {
    this.source = source;
    this.store = store;
    this.on_arrival = on_arrival;
    this.max_requests = max_requests;  // at the same time
    this.max_batch = max_batch;
    this.allowed = max_requests;       // fewer while the service is busy
    this.batch_size = max_batch;       // smaller where it is silent for long
    this.queue = [];
    this.loading = new Map();    // key -> request
    this.failures = new Map();   // key -> {count, retry_ms, batch: the largest that it may be in, last}, the oldest first
    this.max_failures = kMaxFailures;
    this.requests = 0;
    this.failed_total = 0;
    this.requested_total = 0;
    this.outage = {count: 0, retry_ms: 0};
    this.busy = {count: 0, retry_ms: 0};
    this.full_until_ms = 0;      // Infinity: until the next epoch
    this.trouble = null;         // {code, message}: as long as the outage
    this.failure = null;         // the same, for good
    this.refusal = null;         // the same: of some items only
    this.warnings = 0;
    this.timer = 0;
    this.wakes = new Set();      // times
    this.unmet = 0;              // what the last reading wanted and may still come
    this.ending = new AbortController();
  }

  // null, or {code, message} of what is to be said.
  get problem() {
    return this.failure ?? this.source.ended ?? this.trouble ?? this.refusal;
  }
  get disposed() {
    return this.ending.signal.aborted;
  }
  // Whether nothing is asked for any more.
  get has_ended() {
    return this.disposed || this.source.ended !== null || this.failure !== null;
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

  // Whether it is not asked for any more, for minutes.
  is_refused(key, now_ms) {
    const failure = this.failures.get(key);
    return failure !== undefined && failure.count >= kMaxTries && now_ms < failure.retry_ms;
  }

  may_ask(key, now_ms) {
    return !(now_ms < this.failures.get(key)?.retry_ms) && now_ms >= this.full_until_ms;
  }

  // `requests` are those of one reading, of which `unmet` may still come.
  replace_queue(requests, unmet, now_ms) {
    this.unmet = unmet;
    if (unmet === 0) this.end_outage();
    // What the service may fail at comes last, and of that what is more likely so: others are not to wait for it.
    const trust = ({key}) => this.failures.get(key)?.last ? this.failures.get(key).batch : this.max_batch;
    this.queue = requests.sort((a, b) => trust(a) - trust(b) || a.priority - b.priority);
    this.send(now_ms);
  }

  // Until when nothing is asked for.
  get retry_ms() {
    return Math.max(this.outage.retry_ms, this.busy.retry_ms);
  }

  send(now_ms) {
    if (this.has_ended) {
      this.queue = [];
      return;
    }
    if (now_ms < this.retry_ms) {
      this.wake_at(this.retry_ms, now_ms);
      return;
    }
    // After an outage one request tries whether it is over.
    const max_requests = this.outage.count > 0 ? 1 : Math.floor(this.allowed);
    while (this.requests < max_requests && this.queue.length > 0 && !this.is_full) this.fetch(this.take_batch());
  }

  take_batch() {
    const size_for = ({key}) => Math.min(this.batch_size, this.failures.get(key)?.batch ?? Infinity);
    const batch = [this.queue.pop()], size = size_for(batch[0]);
    while (batch.length < size && this.queue.length > 0 && size_for(this.queue.at(-1)) === size) batch.push(this.queue.pop());
    return batch;
  }

  async fetch(batch) {
    const {signal} = this.ending, begin_ms = performance.now();
    this.requests++;
    this.requested_total += batch.length;
    for (const request of batch) this.loading.set(request.key, request);
    let answer = null, error = null;
    try {
      // What was of no use is not to come from the browser's cache again.
      const again = batch.some(({key}) => this.failures.has(key));
      answer = await this.fetch_all(batch, {signal, cache: again ? "reload" : undefined});
    } catch (caught) {
      error = caught;
      if (error.is_missing && !this.disposed) await this.source.look_again(signal);
    }
    this.requests--;
    for (const request of batch) this.loading.delete(request.key);
    if (this.disposed) return;
    const now_ms = performance.now();
    if (answer) this.accept(batch, answer, begin_ms, now_ms);
    else this.refuse(batch, error, now_ms);
    this.send(now_ms);
    this.on_arrival(answer === null);
  }

  end_outage() {
    this.outage = {count: 0, retry_ms: 0};
    this.trouble = null;
  }

  accept(batch, answer, begin_ms, now_ms) {
    this.end_outage();
    this.busy = {count: 0, retry_ms: 0};
    this.allowed = Math.min(this.max_requests, this.allowed + 1 / 4);
    if (now_ms - begin_ms < this.source.timeout_ms / 4) this.batch_size = Math.min(this.max_batch, 2 * this.batch_size);
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
        this.note_failure(request, error, now_ms);
      }
    });
  }

  refuse(batch, error, now_ms) {
    if (this.has_ended) return;
    const is_known = error instanceof TileError;
    if (error.timed_out) this.batch_size = Math.max(1, this.batch_size >> 1);
    if (error.is_busy) this.rest(error.retry_after_ms, now_ms);
    else if (error.is_denied) this.pause({code: "unauthorized", message: error.message}, now_ms);
    else if (is_known && (error.is_transient || error.is_suspicious)) this.pause({code: "unreachable", message: error.message}, now_ms);
    else this.end_outage();
    if (is_known && (error.is_denied || error.is_transient) && !error.is_suspicious) this.ask_again(batch);
    else this.split(batch, error, now_ms);
  }

  // One of them is at fault, which halving finds.
  split(batch, error, now_ms) {
    if (batch.length === 1) return this.note_failure(batch[0], error, now_ms);
    const half = Math.ceil(batch.length / 2);
    const last = error.is_suspicious === true;
    for (const {key} of batch) this.remember(key, {count: 0, retry_ms: 0, ...this.failures.get(key), batch: half, last});
    if (last) this.queue.unshift(...batch.reverse());
    else this.ask_again(batch);
  }

  // Before all others, in the same order.
  ask_again(batch) {
    this.queue.push(...batch.reverse());
  }

  // What failed longest ago is forgotten, and asked for like anything else if it is wanted again.
  remember(key, failure) {
    this.failures.delete(key);
    this.failures.set(key, failure);
    if (this.failures.size > this.max_failures) this.failures.delete(this.failures.keys().next().value);
  }

  note_failure(request, error, now_ms) {
    const {key} = request, is_answer = error instanceof TileError && error.status !== 200;
    const tries = 1 + (this.failures.get(key)?.count ?? 0);
    // An answer that says that there is nothing needs no second try.
    const count = is_answer && !error.is_transient ? Math.max(kMaxTries, tries) : tries;
    const retry_ms = now_ms + (count < kMaxTries ? kFirstPauseMs * 2 ** count : kRefusedMs);
    this.remember(key, {count, retry_ms, batch: 1, last: true});
    this.failed_total++;
    if (count < kMaxTries) this.wake_at(retry_ms, now_ms);
    else this.refusal = is_answer && !error.is_missing && error.code !== "corrupt" ? this.refusal ?? kRefused : kDamaged;
    if (this.warnings++ < kMaxWarnings)
      console.warn(`voxdag: ${this.name_of(request)} cannot be used${count < kMaxTries ? " and is asked for again" : ""}: ${error.message}`);
  }

  // The service is away, or answers nothing that makes sense. Requests that fail together count once.
  pause(trouble, now_ms) {
    this.failed_total++;
    this.trouble = trouble;
    if (now_ms < this.outage.retry_ms) return;
    this.outage.count++;
    this.outage.retry_ms = now_ms + pause_after(this.outage.count);
    this.wake_at(this.outage.retry_ms, now_ms);
  }

  // The service has too much to do: no outage, and nothing to be said.
  rest(retry_after_ms, now_ms) {
    this.end_outage();
    if (now_ms < this.busy.retry_ms) return;
    this.busy.count++;
    this.busy.retry_ms = now_ms + Math.min(kMaxBusyMs, retry_after_ms) + pause_after(this.busy.count);
    this.allowed = Math.max(1, this.allowed / 2);
    this.wake_at(this.busy.retry_ms, now_ms);
  }

  // Nothing will come any more, as the error says. What is known of the file says more.
  fail(error) {
    this.failure = this.source.ended ?? {code: error.is_denied ? "unauthorized" : "failed", message: error.message};
    this.queue = [];
  }

  // Whether something wanted may still arrive though no request is under way.
  get awaits_retry() {
    const now_ms = performance.now();
    if (this.has_ended || this.unmet === 0) return false;
    return this.outage.count > 0 || now_ms < this.busy.retry_ms ||
           (now_ms < this.full_until_ms && this.full_until_ms !== Infinity) ||
           [...this.failures.values()].some((f) => f.count > 0 && f.count < kMaxTries && now_ms < f.retry_ms);
  }

  // Whether nothing is asked for until a time that wakes the renderer.
  pauses(now_ms) {
    return this.requests === 0 && now_ms < this.retry_ms;
  }

  wake_at(time_ms, now_ms) {
    this.wakes.add(time_ms);
    this.set_timer(now_ms);
  }

  set_timer(now_ms) {
    clearTimeout(this.timer);
    if (this.wakes.size === 0 || this.disposed) return;
    this.timer = setTimeout(() => this.wake(performance.now()), Math.max(0, Math.min(...this.wakes) - now_ms) + 1);
  }

  wake(now_ms) {
    for (const time_ms of this.wakes) if (time_ms <= now_ms) this.wakes.delete(time_ms);
    this.set_timer(now_ms);
    this.send(now_ms);
    this.on_arrival(true);
  }

  // Ends what is under way, too.
  dispose() {
    this.ending.abort();
    clearTimeout(this.timer);
  }
}
