// Measurements of a renderer, for the panel and for benchmarks.

export const kBlockBytes = 256;  // block size of the pools; a tile or color page has at least one

export class Statistics {
  constructor(beginMs) {
    this.beginMs = beginMs;  // time at which the page began to load
    this.firstPictureMs = null;
    this.firstPictureBytes = 0;
    this.rays = this.stepsMean = this.steps99 = 0;
  }

  noteFrame({stepsMean, steps99}, rays) {
    Object.assign(this, {stepsMean, steps99, rays});
  }

  get hasFirstPicture() {
    return this.firstPictureMs !== null;
  }

  noteFirstPicture(nowMs, fetchedBytes) {
    if (this.hasFirstPicture) return;
    this.firstPictureMs = nowMs - this.beginMs;
    this.firstPictureBytes = fetchedBytes;
    mark("first picture");
  }

  report({context, stream, frames, pace, source, budgetBytes}) {
    const {rays, stepsMean, steps99, firstPictureMs, firstPictureBytes} = this;
    return {
      ...streamReport(stream),
      fps: pace.frameMs > 0 ? 1000 / pace.frameMs : 0,
      targetBytes: context.passes?.targetBytes || 0,
      budgetBytes,
      rays,
      stepsMean,
      steps99,
      internalWidth: context.passes?.targets?.width || 0,
      internalHeight: context.passes?.targets?.height || 0,
      samples: frames.samples,
      compileMs: context.compileMs,
      firstPictureMs,
      firstPictureBytes,
      fetchedBytes: source.fetchedBytes,
    };
  }
}

function streamReport(stream) {
  const store = stream?.store, colors = stream?.colors;
  const loaders = stream ? [stream.loader, ...(colors ? [colors.loader] : [])] : [];
  const sum = (count) => loaders.reduce((total, loader) => total + count(loader), 0);
  return {
    tiles: store?.tiles.size || 0,
    tileBytes: store?.tileBytes || 0,
    poolBytes: store?.pool.bytes || 0,
    requested: sum((loader) => loader.requestedTotal),
    failed: sum((loader) => loader.failedTotal),
    loading: sum((loader) => loader.loading.size + loader.queue.length),
    full: loaders.some((loader) => loader.isFull),
    colorPages: colors?.store.pages.size || 0,
    colorBytes: (colors?.store.usedBlocks || 0) * kBlockBytes,
    colorPoolBytes: colors?.store.bytes || 0,
    evicted: store?.evicted || 0,
  };
}

// Records the current time under a name; the browser's developer tools show it.
export function mark(name) {
  performance.mark(`voxdag: ${name}`);
}
