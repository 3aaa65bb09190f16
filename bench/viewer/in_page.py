"""JavaScript functions that the measurement runs in the viewer's page."""

# By default, the browser keeps the timing entries of only 250 requests.
KEEP_ENTRIES = "performance.setResourceTimingBufferSize(200000);"

# Draws pictures in large parts; a slow, busy machine would otherwise draw very many small parts.
# Switches ambient occlusion off, because it needs no tiles.
IN_LARGE_PARTS = """() => {
  const {viewer, renderer} = window.voxdagViewer;
  Object.defineProperty(renderer.pace, "partPixels", {get: () => 1 << 19, set() {}});
  viewer.setOptions({occlusion: false});
}"""

# Returns the seconds from the beginning of the view until it is complete, that is, until no tile is
# missing in two pictures in a row. In a view within the scene, the sun then moves to its final
# position; with `done`, the function also waits for that. `camera` is null for the camera in the
# page's address.
UNTIL_COMPLETE = """async ([camera, done]) => {
  const {viewer, renderer} = window.voxdagViewer,
                 frame = () => new Promise((resolve) => requestAnimationFrame(resolve));
  const begin = camera === null ? 0 : performance.now();
  if (camera !== null) {
    viewer.flyToText(camera);
    await frame();
    await frame();
  }
  while (!renderer.isComplete) await frame();
  const completeS = (performance.now() - begin) / 1000;
  if (done) await renderer.complete();
  return {
    completeS,
    doneS: (performance.now() - begin) / 1000,
    firstPictureS: renderer.measured.firstPictureMs / 1000,
    compileS: renderer.context.compileMs / 1000,
    coarsePixels: renderer.progress.coarsePixels,
    full: renderer.stream.loader.isFull,
    width: renderer.canvas.width,
    height: renderer.canvas.height,
    ...renderer.statistics()
  };
}"""

# Returns a list for each request from number `from` on: address, start and end in ms, bytes as
# sent.
REQUESTS = """(from) =>
    [...performance.getEntriesByType("navigation"), ...performance.getEntriesByType("resource")]
        .slice(from)
        .map(
            (e) => [e.name, e.startTime, e.responseEnd,
                    e.transferSize > 0 ? e.encodedBodySize : 0])"""

# Returns statistics of all rays of the picture: a histogram of their steps, the fraction of rays
# that hit, the width in pixels of the widest cell, and the level and position of the finest tile in
# which each ray ends.
HITS = """async () => {
  const {renderer} = window.voxdagViewer, {info, view, context: {passes}} = renderer,
        {width, height} = renderer.size;
  const words = passes.capture(renderer.uniforms(width, height), width, height),
        floats = new Float32Array(words.buffer);
  const steps = new Array(4097).fill(0), places = new Set(), pixel = view.pixel(height);
  let hits = 0, widest = 0;
  for (let row = 0; row < height; ++row)
    for (let column = 0; column < width; ++column) {
      const from = 4 * ((height - 1 - row) * width + column), state = words[from + 1],
            t = floats[from];
      ++steps[Math.min(4096, state & 0xffff)];
      if ((state >>> 23 & 1) === 0) continue;
      ++hits;
      const scale = state >>> 16 & 31, axis = state >>> 21 & 3, size = 2 ** scale;
      if (scale > 0) widest = Math.max(widest, size / (t * pixel));
      const along = view.direction(column + 0.5, row + 0.5, width, height);
      const at = view.eye.map(
          (x, i) =>
              Math.floor(x + t * along[i] + (i === axis ? Math.sign(along[i]) * size / 2 : 0)));
      let edge = 2 + info.tile_levels;
      while (edge - 2 <= scale) edge += info.tile_levels;  // the coarse brick above has the others
      edge = Math.min(edge, info.levels);
      places.add([info.levels - edge, ...at.map((x) => x >> edge)].join());
    }
  return {steps, hits: hits / (width * height), widest, places: [...places].join(" ")};
}"""

# Returns, for one sample of the picture, histograms of the steps of the rays to the sun and to the
# sky, and the milliseconds of each rendering pass.
LIGHT_STEPS = """async () => {
  const {Program} = await import("/viewer/gl/gl_objects.js");
  const {kLight, kOcclusion} = await import("/viewer/gl/picture_shaders.js");
  const {renderer} = window.voxdagViewer, {passes, gl} = renderer.context,
        {width, height} = renderer.size;
  passes.resize(width, height, renderer.size, renderer.stream.colors !== null);
  const values = {
    ...renderer.uniforms(width, height),
    u_frame: 1,
    u_seed: 1,
    u_jitter: [0, 0],
    u_occlusion: true
  };
  const names = ["trace", "light", "occlusion", "combine", "feedback"], passMs = {},
        pixel = new Uint8Array(4);
  const wait = () => {
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  };
  let all = null;
  for (const name of names)
    passes[name].draw = function(target, itsValues, ...rest) {
      if (name === "light") all = itsValues;
      wait();
      const begin = performance.now();
      Program.prototype.draw.call(this, target, itsValues, ...rest);
      wait();
      passMs[name] = Math.round(performance.now() - begin);
    };
  for (const part of passes.draw(values, () => 1e9))
    ;
  for (const name of names) delete passes[name].draw;
  const counted = (text, output) =>
      text.replace("void main() {", "void counted() {") + `\\nvoid main() { counted(); ${output} }`;
  const run = (name, text, target, columns, rows, words) => {
    const program = new Program(gl, name, text);
    program.finish();
    program.draw(target, all, columns, rows);
    if (words) {
      gl.readBuffer(gl.COLOR_ATTACHMENT2);
      gl.readPixels(0, 0, columns, rows, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
      gl.readBuffer(gl.COLOR_ATTACHMENT0);
      return words.filter((_, i) => i % 4 === 0);
    }
    const bytes = new Uint8Array(4 * columns * rows);
    gl.readPixels(0, 0, columns, rows, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    return Uint32Array.from(
        {length: columns * rows}, (_, i) => bytes[4 * i] + 256 * bytes[4 * i + 1]);
  };
  const histogram = (numbers) => {
    const out = new Array(4097).fill(0);
    for (const n of numbers)
      if (n > 0) ++out[Math.min(4096, n)];
    return out;
  };
  const {light, sky} = passes.targets;
  const sunRays =
      run("steps of light", counted(kLight, "o_missing = uint(step_count);"), light, width, height,
          new Uint32Array(4 * width * height));
  const skyRays =
      run("steps of occlusion",
          counted(
              kOcclusion,
              "o_sky = vec4(float(step_count & 255), float(step_count >> 8), 0.0, 255.0) / 255.0;"),
          sky, Math.ceil(width / 2), Math.ceil(height / 2), null);
  return {sun: histogram(sunRays), sky: histogram(skyRays), passMs};
}"""

# Draws `count` frames with all pixels of the canvas while the camera turns to one side and back.
# Returns the duration in seconds and statistics.
FRAMES = """async ([count, width, height]) => {
  const {viewer, renderer} = window.voxdagViewer,
                 frame = () => new Promise((resolve) => requestAnimationFrame(resolve));
  renderer.internalSize = () => ({width, height, isFull: true});
  const begin = performance.now(), end = renderer.frames.seed + count;
  for (let i = 0; renderer.frames.seed < end; ++i) {
    viewer.camera.turn(i % 24 < 12 ? 0.004 : -0.004, 0);
    viewer.schedule();
    await frame();
  }
  const wall_s = (performance.now() - begin) / 1000,
        {stepsMean, internalWidth, internalHeight, loading} = renderer.statistics();
  delete renderer.internalSize;
  return {wall_s, stepsMean, internalWidth, internalHeight, loading};
}"""

# Moves the camera through all cameras in turn, and then from the first again. Each leg takes `legS`
# seconds; in the last quarter the camera does not move.
FLIGHT = """([cameras, legS]) => {
  const {viewer} = window.voxdagViewer,
        numbers = cameras.map((text) => text.match(/-?[0-9.]+(?:e-?[0-9]+)?/g).map(Number));
  const begin = performance.now(), out = window.itsFlight = {frames: 0, stopped: false};
  const step = () => {
    if (out.stopped) return;
    const legs = (performance.now() - begin) / 1000 / legS, leg = Math.floor(legs),
          share = Math.min(1, (legs - leg) / 0.75);
    const of = (i) => numbers[i % numbers.length], smooth = share * share * (3 - 2 * share);
    const [ex, ey, ez, tx, ty, tz, fov] = of(leg).map((x, i) => x + smooth * (of(leg + 1)[i] - x));
    viewer.flyToText(`--camera ${ex},${ey},${ez} --target ${tx},${ty},${tz} --fov ${fov}`);
    ++out.frames;
    requestAnimationFrame(step);
  };
  step();
}"""

# Returns times in milliseconds since the request for the page; null before the first picture.
FIRST = """() => {
  const {renderer} = window.voxdagViewer ?? {};
  if (renderer?.measured.firstPictureMs == null) return null;
  const {beginMs, firstPictureMs} = renderer.measured, statistics = renderer.statistics();
  return {
    begin: beginMs,
    compile: statistics.compileMs,
    first: beginMs + firstPictureMs,
    tiles: statistics.tiles,
    width: renderer.canvas.width,
    height: renderer.canvas.height,
    marks: performance.getEntriesByType("mark").map((e) => [e.name, Math.round(e.startTime)])
  };
}"""
