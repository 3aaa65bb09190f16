// Fetches the color pages that a picture lacks.

import {Loader} from "../tiles/loader.js";

const kMaxRequests = 2, kMaxBatch = 128;

// Its requests are {key, level, position, priority}.
export class ColorLoader extends Loader {
  constructor(source, store, on_arrival) {
    super(source, store, on_arrival, {max_requests: kMaxRequests, max_batch: Math.min(kMaxBatch, source.info.colors.batch_max)});
  }

  // `wanted`: key -> request, of one reading of the feedback.
  demand(wanted, now_ms) {
    const requests = [];
    let unmet = 0;
    for (const request of wanted.values()) {
      const {key} = request;
      if (this.store.pages.has(key) || this.is_refused(key, now_ms)) continue;
      unmet++;
      if (!this.loading.has(key) && this.may_ask(key, now_ms)) requests.push(request);
    }
    this.replace_queue(requests, unmet, now_ms);
  }

  name_of({level, position}) {
    return `color page ${[level, ...position].join("/")}`;
  }

  fetch_all(batch, options) {
    return this.source.fetchColors(batch, options);
  }

  keep(request, words, now_ms) {
    return this.store.add(request, words, now_ms);
  }
}
