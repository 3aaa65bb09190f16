// Fetches the color pages that a picture needs but that are not loaded.

import {Loader} from "../tiles/loader.js";

const kMaxRequests = 2, kMaxBatch = 128;

// Requests are {key, level, position, priority}.
export class ColorLoader extends Loader {
  constructor(source, store, onArrival) {
    super(
        source, store, onArrival,
        {maxRequests: kMaxRequests, maxBatch: Math.min(kMaxBatch, source.info.colors.batch_max)});
  }

  // Requests the missing pages of one reading of the color feedback (gl/color_shader.js). `wanted`
  // maps key -> request.
  demand(wanted, nowMs) {
    const requests = [];
    let unmet = 0;
    for (const request of wanted.values()) {
      const {key} = request;
      if (this.store.pages.has(key) || this.isRefused(key, nowMs)) continue;
      unmet++;
      if (!this.loading.has(key) && this.mayAsk(key, nowMs)) requests.push(request);
    }
    this.replaceQueue(requests, unmet, nowMs);
  }

  nameOf({level, position}) {
    return `color page ${[level, ...position].join("/")}`;
  }

  fetchAll(batch, options) {
    return this.source.fetchColors(batch, options);
  }

  keep(request, words, nowMs) {
    return this.store.add(request, words, nowMs);
  }
}
