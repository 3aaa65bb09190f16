// The uniforms of all rays of a picture.

const kConeShare = 0.75;  // in pixels: rays hit a cell of up to this width as one solid cube

// Returns the uniforms for a picture of width x height pixels, drawn by `renderer` with its loaded
// tiles. Its cells are as fine as in a picture with `lodHeight` rows.
export function pictureValues(renderer, width, height, lodHeight) {
  const {info, options, view, light, stream: {store, colors, rootPointer}} = renderer,
                                                             levels = info.levels,
                                                             edge = 2 ** levels;
  const clip = options.clip || {low: [0, 0, 0], high: [edge, edge, edge]};
  const bound = (p) => p.map((x) => Math.min(Math.max(Math.round(x), 0), edge));
  const finest = 2 ** (levels - Math.min(levels, Math.max(1, options.maxLevel ?? levels)));
  const coarsest = Math.max(finest, 2 ** (levels - Math.min(levels, options.minLevel || 0)));
  let boundaries = 0;
  for (let scale = 2; scale <= levels; scale += info.tile_levels) boundaries |= 1 << scale;
  const colored = colors !== null && options.color;
  const pages = colored ? colors.uniforms() : {
    u_page_texels: store.pool.texels,
    u_page_table: store.pool.table,
    u_page_mask: 0,
    u_color_levels: -1
  };
  return {
    ...view.uniforms(width, height),
    ...pages,
    u_pool: store.pool.texels,
    u_table: store.pool.table,
    u_root: rootPointer,
    u_levels: levels,
    u_boundaries: boundaries,
    u_clip_low: bound(clip.low),
    u_clip_high: bound(clip.high),
    u_cell_sizes: [finest, coarsest],
    u_cone: kConeShare * options.pixelTolerance * view.pixel(lodHeight),
    u_seed: 0,
    u_jitter: [0, 0],
    u_wire_scale: options.wireLevel === null ? -1 : levels - options.wireLevel,
    u_wire_width: view.pixel(height),
    u_wire_fade: [light.distanceOfScene(view.eye), 1 / Math.max(1, light.diagonal)],
    u_sun: light.sun,
    u_sky_reach: light.skyReach,
    u_haze: [light.hazeStart, 1 / Math.max(1, light.diagonal)],
    ...light.floor(view.eye),
    u_occlusion: options.ambientOcclusion,
    u_shadows: options.sunShadows,
    u_frame: 0,
  };
}

// Returns the offset of a sample from the center of its pixel; sample 0 is at the center.
export function jitterOf(sample) {
  const wrap = (x) => x - Math.floor(x);
  return [
    wrap(0.5 + 0.7548776662466927 * sample) - 0.5, wrap(0.5 + 0.5698402909980532 * sample) - 0.5
  ];
}
