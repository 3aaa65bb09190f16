// Schedules the requests for tiles or color pages, and retries failed requests. Each reading of the
// feedback (gl/feedback.js) replaces the queue, so items that are no longer in the picture are not
// fetched.

import {TileError} from "../tile_source.js";

// Number of consecutive readings that mark all items that the view uses. So the view does not use
// an item that none of these readings has marked.
export const kRoundsToKnow = 4;
const kFirstPauseMs = 300, kMaxPauseMs = 10000, kMaxBusyMs = 60000;
const kMaxTries = 3;         // tries per item if the answers are unusable
const kRefusedMs = 300000;   // time until a refused item is requested again
const kMaxFailures = 65536;  // maximum number of remembered failures
const kMaxWarnings = 20;
const kFullPauseMs = 250;

const kRefused = {
  code: "refused",
  message: "Part of the file is drawn coarse: the service fails to send it."
};

// Returns the pause in ms before a retry. It is random, so that the clients of a restarted service
// do not all return at the same time.
export function pauseAfter(failures) {
  return Math.min(kMaxPauseMs, kFirstPauseMs * 2 ** (failures - 1)) * (0.5 + 0.5 * Math.random());
}

// Base class of TileLoader and ColorLoader. A request is {key, priority, ...}. `source.damage` is
// the problem that the page reports for a damaged item. Derived classes have these functions:
//
//     async fetchAll(batch, options)
//                                    resolves to the answers, in the order of the requests; an
//                                    answer is an Error if only its item is not available
//     keep(request, answer, nowMs)   false if there is no space; throws if the answer is damaged
//     nameOf(request)                the item's name for messages
//
// `store.rounds` must be the number of readings since the view changed.
export class Loader {
  // onArrival() is called when an item has arrived. onArrival(true) is called when a request has
  // failed or the state of retries has changed.
  constructor(source, store, onArrival, {maxRequests, maxBatch}) {
    this.source = source;
    this.store = store;
    this.onArrival = onArrival;
    this.maxRequests = maxRequests;  // concurrent requests
    this.maxBatch = maxBatch;
    this.allowed = maxRequests;  // concurrent requests allowed now; fewer while the service is busy
    this.batchSize = maxBatch;   // maximum size of a batch; smaller after timeouts
    this.queue = [];
    this.loading = new Map();  // key -> request
    // The failures of items, the oldest first: key -> {count, retryMs, batch, last}. `batch` is the
    // size of the largest batch in which the item may be requested. Items for which `last` is true
    // are requested after all other items.
    this.failures = new Map();
    this.maxFailures = kMaxFailures;
    this.requests = 0;
    this.failedTotal = 0;
    this.requestedTotal = 0;
    this.outage = {count: 0, retryMs: 0};
    this.busy = {count: 0, retryMs: 0};
    this.fullUntilMs = 0;  // the store has no space until then; Infinity: until the next epoch
    this.trouble = null;   // {code, message} of the current outage
    this.failure = null;   // {code, message} of the error that ended loading
    this.refusal = null;   // {code, message} if some items were refused
    this.warnings = 0;
    this.timer = 0;
    this.wakes = new Set();  // times of scheduled wake-ups
    this.unmet = 0;          // number of items missing in the last reading that can still arrive
    this.ending = new AbortController();
  }

  // The problem to show to the user, {code, message}; null without one.
  get problem() {
    return this.failure ?? this.source.ended ?? this.trouble ?? this.refusal;
  }
  get disposed() {
    return this.ending.signal.aborted;
  }
  // True once the loader has stopped requesting items.
  get hasEnded() {
    return this.disposed || this.source.ended !== null || this.failure !== null;
  }

  // True if no request waits in the queue or for its answer.
  get isIdle() {
    return this.requests === 0 && this.queue.length === 0;
  }
  get isFull() {
    return performance.now() < this.fullUntilMs;
  }

  beginEpoch() {
    if (this.fullUntilMs === Infinity) this.fullUntilMs = 0;
  }

  // True if an item was refused a short time ago. Such an item is not requested for some minutes.
  isRefused(key, nowMs) {
    const failure = this.failures.get(key);
    return failure !== undefined && failure.count >= kMaxTries && nowMs < failure.retryMs;
  }

  mayAsk(key, nowMs) {
    return !(nowMs < this.failures.get(key)?.retryMs) && nowMs >= this.fullUntilMs;
  }

  // Replaces the queue by the `requests` of one reading. `unmet`: number of the reading's missing
  // items that can still arrive.
  replaceQueue(requests, unmet, nowMs) {
    this.unmet = unmet;
    if (unmet === 0) this.endOutage();
    // takeBatch() takes items from the end of the queue, so the items that are requested first are
    // sorted to the end. Items that possibly caused an error (`last`) are requested after all other
    // items, so that they do not delay the other items. Among the items with `last`, an item with a
    // smaller `batch` (the size of the largest batch in which the item may be requested) is
    // requested later.
    const trust = ({key}) =>
        this.failures.get(key)?.last ? this.failures.get(key).batch : this.maxBatch;
    this.queue = requests.sort((a, b) => trust(a) - trust(b) || a.priority - b.priority);
    this.send(nowMs);
  }

  // No request is sent before this time.
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
    // During an outage a single request probes the service.
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
      // Bypasses the browser's cache for an item that has failed, because the cache may contain the
      // unusable answer.
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
        if (answer[i] instanceof Error) throw answer[i];
        if (this.keep(request, answer[i], nowMs)) {
          this.failures.delete(request.key);
        } else {
          hasRoom = false;
          // After kRoundsToKnow readings, the store knows the unused items and can evict them.
          // If there is still no space, the view needs all remaining items.
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

  // One item of the batch possibly caused the error. To find this item, requests the items again in
  // batches of at most half the size.
  split(batch, error, nowMs) {
    if (batch.length === 1) return this.noteFailure(batch[0], error, nowMs);
    const half = Math.ceil(batch.length / 2);
    const last = error.isSuspicious === true;
    for (const {key} of batch)
      this.remember(key, {count: 0, retryMs: 0, ...this.failures.get(key), batch: half, last});
    if (last) this.queue.unshift(...batch.reverse());
    else this.askAgain(batch);
  }

  // Puts a batch back into the queue, so that its items are requested before all other items and in
  // the same order.
  askAgain(batch) {
    this.queue.push(...batch.reverse());
  }

  // Stores a failure. If there are too many, forgets the oldest failure. Its item is then requested
  // like an item without failures.
  remember(key, failure) {
    this.failures.delete(key);
    this.failures.set(key, failure);
    if (this.failures.size > this.maxFailures)
      this.failures.delete(this.failures.keys().next().value);
  }

  noteFailure(request, error, nowMs) {
    const {key} = request, isAnswer = error instanceof TileError && error.status !== 200;
    const tries = 1 + (this.failures.get(key)?.count ?? 0);
    // A definite refusal needs no second try.
    const count = isAnswer && !error.isTransient ? Math.max(kMaxTries, tries) : tries;
    const retryMs = nowMs + (count < kMaxTries ? kFirstPauseMs * 2 ** count : kRefusedMs);
    this.remember(key, {count, retryMs, batch: 1, last: true});
    this.failedTotal++;
    if (count < kMaxTries) this.wakeAt(retryMs, nowMs);
    else
      this.refusal = isAnswer && !error.isMissing && error.code !== "corrupt" ?
          this.refusal ?? kRefused :
          this.source.damage;
    if (this.warnings++ < kMaxWarnings)
      console.warn(`voxdag: ${this.nameOf(request)} is unusable${
          count < kMaxTries ? " and is requested again" : ""}: ${error.message}`);
  }

  // Pauses, because the service does not answer or its answers make no sense. Failures of
  // concurrent requests count as one.
  pause(trouble, nowMs) {
    this.failedTotal++;
    this.trouble = trouble;
    if (nowMs < this.outage.retryMs) return;
    this.outage.count++;
    this.outage.retryMs = nowMs + pauseAfter(this.outage.count);
    this.wakeAt(this.outage.retryMs, nowMs);
  }

  // Pauses, because the service is busy. This is not an outage, so the user sees no message.
  rest(retryAfterMs, nowMs) {
    this.endOutage();
    if (nowMs < this.busy.retryMs) return;
    this.busy.count++;
    this.busy.retryMs = nowMs + Math.min(kMaxBusyMs, retryAfterMs) + pauseAfter(this.busy.count);
    this.allowed = Math.max(1, this.allowed / 2);
    this.wakeAt(this.busy.retryMs, nowMs);
  }

  // Stops loading after a fatal error. If the file is known to have changed, reports this change,
  // which explains the failure better than the error.
  fail(error) {
    this.failure = this.source.ended ??
        {code: error.isDenied ? "unauthorized" : "failed", message: error.message};
    this.queue = [];
  }

  // True if wanted items are missing and can still arrive after a retry.
  get awaitsRetry() {
    const nowMs = performance.now();
    if (this.hasEnded || this.unmet === 0) return false;
    return this.outage.count > 0 || nowMs < this.busy.retryMs ||
        (nowMs < this.fullUntilMs && this.fullUntilMs !== Infinity) ||
        [...this.failures.values()].some(
            (f) => f.count > 0 && f.count < kMaxTries && nowMs < f.retryMs);
  }

  // True if no request is in progress and none is sent before retryMs.
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

  // Aborts all requests.
  dispose() {
    this.ending.abort();
    clearTimeout(this.timer);
  }
}
