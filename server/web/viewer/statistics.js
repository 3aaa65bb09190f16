// What a renderer says of itself: for the panel, and for whoever measures it.

export const kBlockBytes = 256;  // of the pools: the least that a tile or the colors of a page take

export function statistics_of(renderer) {
  const {loader, store, passes, times, colors, pace, stats} = renderer, page_loader = colors?.loader;
  const sum = (of) => [loader, page_loader].reduce((all, each) => all + (each ? of(each) : 0), 0);
  return {
    fps: pace.frame_ms > 0 ? 1000 / pace.frame_ms : 0, tiles: store?.tiles.size || 0, tileBytes: store?.tile_bytes || 0,
    poolBytes: store?.pool.bytes || 0, targetBytes: passes?.target_bytes || 0, budgetBytes: renderer.budget_bytes,
    requested: sum((each) => each.requested_total), failed: sum((each) => each.failed_total),
    loading: sum((each) => each.loading.size + each.queue.length), full: loader?.is_full || page_loader?.is_full || false,
    colorPages: colors?.store.pages.size || 0, colorBytes: (colors?.store.used_blocks || 0) * kBlockBytes,
    colorPoolBytes: colors?.store.bytes || 0,
    evicted: store?.evicted || 0, rays: stats.rays, stepsMean: stats.steps_mean, steps99: stats.steps_99,
    internalWidth: passes?.targets?.width || 0, internalHeight: passes?.targets?.height || 0,
    samples: renderer.samples, compileMs: times.compile_ms, firstPictureMs: times.first_picture_ms,
    firstPictureBytes: renderer.first_picture_bytes,
    fetchedBytes: renderer.source.fetched_bytes,
  };
}
