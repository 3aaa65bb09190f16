// What decides what is fetched next, and survives what fails: for tiles and for color pages. Each
// reading of the feedback replaces the queue, so that what has left the picture is not fetched any
// more.

import {TileError} from "../tile_source.js";

export const kRoundsToKnow =
    4;  // readings of the feedback after which what was not seen is known to be so
const kFirstPauseMs = 300, kMaxPauseMs = 10000, kMaxBusyMs = 60000;
const kMaxTries = 3;         // of one item whose answers are of no use
const kRefusedMs = 300000;   // until an item that was refused is asked for again
const kMaxFailures = 65536;  // that are remembered
const kMaxWarnings = 20;
const kFullPauseMs = 250;

const kDamaged = {
  code: "damaged",
  message: "Part of the file is damaged and drawn coarse: run voxdag verify."
};
const kRefused = {
  code: "refused",
  message: "Part of the file is drawn coarse: the service fails to send it."
};

// Random, so that those who lost the same service do not come back at the same time.
export function pauseAfter(failures) {
  return Math.min(kMaxPauseMs, kFirstPauseMs * 2 ** (failures - 1)) * (0.5 + 0.5 * Math.random());
}

// A request is {key, priority, ...}. Derived classes have
//     async fetchAll(batch, options) resolves to the answers, in the order of the requests
//     keep(request, answer, nowMs) false if there is no room; throws if the answer is damaged
//     nameOf(request)              for messages
// and `store.rounds`, the readings since the view changed.
export class Loader {
  // onArrival(failed): something arrived, or, if `failed`, what fails changed.
  constructor(source, store, onArrival, {maxRequests, maxBatch}) {
    this.source = source;
    this.store = store;
    this.onArrival = onArrival;
    this.maxRequests = maxRequests;  // at the same time
    this.maxBatch = maxBatch;
    this.allowed = maxRequests;  // fewer while the service is busy
    this.batchSize = maxBatch;   // smaller where it is silent for long
    this.queue = [];
    this.loading = new Map();   // key -> request
    this.failures = new Map();  // key -> {count, retryMs, batch: the largest that it may be in,
                                // last}, the oldest first
    this.maxFailures = kMaxFailures;
    this.requests = 0;
    this.failedTotal = 0;
    this.requestedTotal = 0;
    this.outage = {count: 0, retryMs: 0};
    this.busy = {count: 0, retryMs: 0};
    this.fullUntilMs = 0;  // Infinity: until the next epoch
    this.trouble = null;   // {code, message}: as long as the outage
    this.failure = null;   // the same, for good
    this.refusal = null;   // the same: of some items only
    this.warnings = 0;
    this.timer = 0;
    this.wakes = new Set();  // times
    this.unmet = 0;          // what the last reading wanted and may still come
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
  get hasEnded() {
    return this.disposed || this.source.ended !== null || this.failure !== null;
  }

  // True if nothing more will arrive for the view, unless it changes.
  get isIdle() {
    return this.requests === 0 && this.queue.length === 0;
  }
  get isFull() {
    return performance.now() < this.fullUntilMs;
  }

  beginEpoch() {
    if (this.fullUntilMs === Infinity) this.fullUntilMs = 0;
  }

  // Whether it is not asked for any more, for minutes.
  isRefused(key, nowMs) {
    const failure = this.failures.get(key);
    return failure !== undefined && failure.count >= kMaxTries && nowMs < failure.retryMs;
  }

  mayAsk(key, nowMs) {
    return !(nowMs < this.failures.get(key)?.retryMs) && nowMs >= this.fullUntilMs;
  }

  // `requests` are those of one reading, of which `unmet` may still come.
  replaceQueue(requests, unmet, nowMs) {
    this.unmet = unmet;
    if (unmet === 0) this.endOutage();
    // What the service may fail at comes last, and of that what is more likely so: others are not
    // to wait for it.
    const trust = ({key}) =>
        this.failures.get(key)?.last ? this.failures.get(key).batch : this.maxBatch;
    this.queue = requests.sort((a, b) => trust(a) - trust(b) || a.priority - b.priority);
    this.send(nowMs);
  }

  // Until when nothing is asked for.
  get retryMs() {
    return Math.max(this.outage.retryMs, this.busy.retryMs);
  }

  send(nowMs) {
    if (this.hasEnded) {
      this.queue = [];
      return;
    }
    if (nowMs < this.retryMs) {
      this.wakeAt(this.retryMs, nowMs);
      return;
    }
    // After an outage one request tries whether it is over.
    const maxRequests = this.outage.count > 0 ? 1 : Math.floor(this.allowed);
    while (this.requests < maxRequests && this.queue.length > 0 && !this.isFull)
      this.fetch(this.takeBatch());
  }

  takeBatch() {
    const sizeFor = ({key}) => Math.min(this.batchSize, this.failures.get(key)?.batch ?? Infinity);
    const batch = [this.queue.pop()], size = sizeFor(batch[0]);
    while (batch.length < size && this.queue.length > 0 && sizeFor(this.queue.at(-1)) === size)
      batch.push(this.queue.pop());
    return batch;
  }

  async fetch(batch) {
    const {signal} = this.ending, beginMs = performance.now();
    this.requests++;
    this.requestedTotal += batch.length;
    for (const request of batch) this.loading.set(request.key, request);
    let answer = null, error = null;
    try {
      // What was of no use is not to come from the browser's cache again.
      const again = batch.some(({key}) => this.failures.has(key));
      answer = await this.fetchAll(batch, {signal, cache: again ? "reload" : undefined});
    } catch (caught) {
      error = caught;
      if (error.isMissing && !this.disposed) await this.source.lookAgain(signal);
    }
    this.requests--;
    for (const request of batch) this.loading.delete(request.key);
    if (this.disposed) return;
    const nowMs = performance.now();
    if (answer) this.accept(batch, answer, beginMs, nowMs);
    else this.refuse(batch, error, nowMs);
    this.send(nowMs);
    this.onArrival(answer === null);
  }

  endOutage() {
    this.outage = {count: 0, retryMs: 0};
    this.trouble = null;
  }

  accept(batch, answer, beginMs, nowMs) {
    this.endOutage();
    this.busy = {count: 0, retryMs: 0};
    this.allowed = Math.min(this.maxRequests, this.allowed + 1 / 4);
    if (nowMs - beginMs < this.source.timeoutMs / 4)
      this.batchSize = Math.min(this.maxBatch, 2 * this.batchSize);
    let hasRoom = true;
    batch.forEach((request, i) => {
      if (!hasRoom) return;
      try {
        if (this.keep(request, answer[i], nowMs)) {
          this.failures.delete(request.key);
        } else {
          hasRoom = false;
          // When the store knows what the view does not need, all that is left is needed.
          this.fullUntilMs = this.store.rounds >= kRoundsToKnow ? Infinity : nowMs + kFullPauseMs;
          this.queue = [];
          this.wakeAt(nowMs + kFullPauseMs, nowMs);
        }
      } catch (error) {
        this.noteFailure(request, error, nowMs);
      }
    });
  }

  refuse(batch, error, nowMs) {
    if (this.hasEnded) return;
    const isKnown = error instanceof TileError;
    if (error.timedOut) this.batchSize = Math.max(1, this.batchSize >> 1);
    if (error.isBusy) this.rest(error.retryAfterMs, nowMs);
    else if (error.isDenied) this.pause({code: "unauthorized", message: error.message}, nowMs);
    else if (isKnown && (error.isTransient || error.isSuspicious))
      this.pause({code: "unreachable", message: error.message}, nowMs);
    else this.endOutage();
    if (isKnown && (error.isDenied || error.isTransient) && !error.isSuspicious)
      this.askAgain(batch);
    else this.split(batch, error, nowMs);
  }

  // One of them is at fault, which halving finds.
  split(batch, error, nowMs) {
    if (batch.length === 1) return this.noteFailure(batch[0], error, nowMs);
    const half = Math.ceil(batch.length / 2);
    const last = error.isSuspicious === true;
    for (const {key} of batch)
      this.remember(key, {count: 0, retryMs: 0, ...this.failures.get(key), batch: half, last});
    if (last) this.queue.unshift(...batch.reverse());
    else this.askAgain(batch);
  }

  // Before all others, in the same order.
  askAgain(batch) {
    this.queue.push(...batch.reverse());
  }

  // What failed longest ago is forgotten, and asked for like anything else if it is wanted again.
  remember(key, failure) {
    this.failures.delete(key);
    this.failures.set(key, failure);
    if (this.failures.size > this.maxFailures)
      this.failures.delete(this.failures.keys().next().value);
  }

  noteFailure(request, error, nowMs) {
    const {key} = request, isAnswer = error instanceof TileError && error.status !== 200;
    const tries = 1 + (this.failures.get(key)?.count ?? 0);
    // An answer that says that there is nothing needs no second try.
    const count = isAnswer && !error.isTransient ? Math.max(kMaxTries, tries) : tries;
    const retryMs = nowMs + (count < kMaxTries ? kFirstPauseMs * 2 ** count : kRefusedMs);
    this.remember(key, {count, retryMs, batch: 1, last: true});
    this.failedTotal++;
    if (count < kMaxTries) this.wakeAt(retryMs, nowMs);
    else
      this.refusal = isAnswer && !error.isMissing && error.code !== "corrupt" ?
          this.refusal ?? kRefused :
          kDamaged;
    if (this.warnings++ < kMaxWarnings)
      console.warn(`voxdag: ${this.nameOf(request)} cannot be used${
          count < kMaxTries ? " and is asked for again" : ""}: ${error.message}`);
  }

  // The service is away, or answers nothing that makes sense. Requests that fail together count
  // once.
  pause(trouble, nowMs) {
    this.failedTotal++;
    this.trouble = trouble;
    if (nowMs < this.outage.retryMs) return;
    this.outage.count++;
    this.outage.retryMs = nowMs + pauseAfter(this.outage.count);
    this.wakeAt(this.outage.retryMs, nowMs);
  }

  // The service has too much to do: no outage, and nothing to be said.
  rest(retryAfterMs, nowMs) {
    this.endOutage();
    if (nowMs < this.busy.retryMs) return;
    this.busy.count++;
    this.busy.retryMs = nowMs + Math.min(kMaxBusyMs, retryAfterMs) + pauseAfter(this.busy.count);
    this.allowed = Math.max(1, this.allowed / 2);
    this.wakeAt(this.busy.retryMs, nowMs);
  }

  // Nothing will come any more, as the error says. What is known of the file says more.
  fail(error) {
    this.failure = this.source.ended ??
        {code: error.isDenied ? "unauthorized" : "failed", message: error.message};
    this.queue = [];
  }

  // Whether something wanted may still arrive though no request is under way.
  get awaitsRetry() {
    const nowMs = performance.now();
    if (this.hasEnded || this.unmet === 0) return false;
    return this.outage.count > 0 || nowMs < this.busy.retryMs ||
        (nowMs < this.fullUntilMs && this.fullUntilMs !== Infinity) ||
        [...this.failures.values()].some(
            (f) => f.count > 0 && f.count < kMaxTries && nowMs < f.retryMs);
  }

  // Whether nothing is asked for until a time that wakes the renderer.
  pauses(nowMs) {
    return this.requests === 0 && nowMs < this.retryMs;
  }

  wakeAt(timeMs, nowMs) {
    this.wakes.add(timeMs);
    this.setTimer(nowMs);
  }

  setTimer(nowMs) {
    clearTimeout(this.timer);
    if (this.wakes.size === 0 || this.disposed) return;
    this.timer = setTimeout(
        () => this.wake(performance.now()), Math.max(0, Math.min(...this.wakes) - nowMs) + 1);
  }

  wake(nowMs) {
    for (const timeMs of this.wakes)
      if (timeMs <= nowMs) this.wakes.delete(timeMs);
    this.setTimer(nowMs);
    this.send(nowMs);
    this.onArrival(true);
  }

  // Ends what is under way, too.
  dispose() {
    this.ending.abort();
    clearTimeout(this.timer);
  }
}
