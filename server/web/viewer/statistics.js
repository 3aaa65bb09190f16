// What a renderer says of itself: for the panel, and for whoever measures it.

export const kBlockBytes = 256;  // of the pools: the least that a tile or the colors of a page take

export function statisticsOf(renderer) {
  const {loader, store, passes, times, colors, pace, stats} = renderer, pageLoader = colors?.loader;
  const sum = (of) => [loader, pageLoader].reduce((all, each) => all + (each ? of(each) : 0), 0);
  return {
    fps: pace.frameMs > 0 ? 1000 / pace.frameMs : 0,
    tiles: store?.tiles.size || 0,
    tileBytes: store?.tileBytes || 0,
    poolBytes: store?.pool.bytes || 0,
    targetBytes: passes?.targetBytes || 0,
    budgetBytes: renderer.budgetBytes,
    requested: sum((each) => each.requestedTotal),
    failed: sum((each) => each.failedTotal),
    loading: sum((each) => each.loading.size + each.queue.length),
    full: loader?.isFull || pageLoader?.isFull || false,
    colorPages: colors?.store.pages.size || 0,
    colorBytes: (colors?.store.usedBlocks || 0) * kBlockBytes,
    colorPoolBytes: colors?.store.bytes || 0,
    evicted: store?.evicted || 0,
    rays: stats.rays,
    stepsMean: stats.stepsMean,
    steps99: stats.steps99,
    internalWidth: passes?.targets?.width || 0,
    internalHeight: passes?.targets?.height || 0,
    samples: renderer.samples,
    compileMs: times.compileMs,
    firstPictureMs: times.firstPictureMs,
    firstPictureBytes: renderer.firstPictureBytes,
    fetchedBytes: renderer.source.fetchedBytes,
  };
}
