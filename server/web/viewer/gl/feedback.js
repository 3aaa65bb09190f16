// Decodes the feedback. The feedback is a small picture that is drawn with each sample of a
// picture. It contains the missing tiles, the used tiles, and statistics. A *reading* is one
// feedback, copied from the GPU.

const kMaxSamples = 4096;  // maximum number of texels that the statistics read
const kHalf = new DataView(new ArrayBuffer(4));

function halfToNumber(bits) {
  const exponent = bits >> 10 & 31, fraction = bits & 1023;
  if (exponent === 0) return fraction * 2 ** -24;
  return (1 + fraction / 1024) * 2 ** (exponent - 15);
}
function bitsToFloat(bits) {
  kHalf.setUint32(0, bits);
  return kHalf.getFloat32(0);
}
function shareOf(sorted, share) {
  return sorted.length === 0 ?
      0 :
      sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
}

// Returns an object with these members:
//
//     wanted         Map from the texel of each cut-off node (tiles/tile_format.js) whose tile is
//                    missing to a priority
//     slots          Set of the slots of used tiles
//     coarsePixels   width of the widest cell whose tile is missing
//     medianT, nearestT   median and minimum distance of the visible surfaces
//     exposure       exposure for these surfaces; null if no surface is visible
//     stepsMean, steps99   mean and 99th percentile of the steps of the rays
//
// The last five values are measured on a sample of the pixels.
export function readFeedback(words) {
  const wanted = new Map(), slots = new Set(), texels = words.length / 4;
  const stride = Math.ceil(texels / kMaxSamples) | 1, count = Math.ceil(texels / stride);
  const steps = new Uint16Array(count), distances = new Float32Array(count),
        luminances = new Float32Array(count);
  let coarsePixels = 0, stepSum = 0, seen = 0;
  for (let at = 0; at < words.length; at += 4) {
    const missing = words[at], pair = words[at + 1];
    if (missing !== 0) {
      const pixels = halfToNumber(pair & 0xffff);
      wanted.set(missing, (wanted.get(missing) || 0) + pixels);
      if (pixels > coarsePixels) coarsePixels = pixels;
    }
    const slot = words[at + 2] & 0x3fffff;
    if (slot !== 0) slots.add(slot);
  }
  for (let i = 0; i < count; ++i) {
    const at = 4 * i * stride, pair = words[at + 1];
    steps[i] = words[at + 2] >>> 22 << 1;
    stepSum += steps[i];
    if (words[at + 3] === 0 && pair >>> 16 === 0) continue;
    distances[seen] = bitsToFloat(words[at + 3]);
    luminances[seen++] = 1e-3 + halfToNumber(pair >>> 16);
  }
  const t = distances.subarray(0, seen).sort(), bright = luminances.subarray(0, seen).sort();
  steps.sort();
  return {
    wanted,
    slots,
    coarsePixels,
    stepsMean: stepSum / Math.max(1, count),
    steps99: shareOf(steps, 0.99),
    medianT: shareOf(t, 0.5),
    nearestT: t[0] || 0,
    exposure: seen === 0 ? null : Math.min(0.42 / shareOf(bright, 0.5), 0.85 / shareOf(bright, 0.9))
  };
}

// Returns {depth, level, steps} of each pixel, in rows from the top. `words` are the results of
// pack_hit(), in rows from the bottom. The depth of the sky is infinite.
export function readHits(words, width, height, levels) {
  const depth = new Float32Array(width * height).fill(Infinity),
        level = new Uint8Array(width * height);
  const steps = new Uint16Array(width * height), floats = new Float32Array(words.buffer);
  for (let i = 0; i < width * height; ++i) {
    const from = 4 * ((height - 1 - Math.floor(i / width)) * width + i % width);
    steps[i] = words[from + 1] & 0xffff;
    if (!(words[from + 1] >>> 23 & 1)) continue;
    depth[i] = floats[from];
    level[i] = levels - (words[from + 1] >>> 16 & 31);
  }
  return {depth, level, steps};
}
