// What a reading of the feedback says: the tiles that are missing, those that were used, and statistics
// of what is seen.

const kHalf = new DataView(new ArrayBuffer(4));

function half_to_number(bits) {
  const exponent = bits >> 10 & 31, fraction = bits & 1023;
  if (exponent === 0) return fraction * 2 ** -24;
  return (1 + fraction / 1024) * 2 ** (exponent - 15);
}
function bits_to_float(bits) {
  kHalf.setUint32(0, bits);
  return kHalf.getFloat32(0);
}
function share_of(sorted, share) {
  return sorted.length === 0 ? 0 : sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
}

// {wanted: Map of leaf address -> priority, slots: Set, coarse_pixels: of the largest missing cell,
//  median_t, nearest_t, exposure (null: nothing is seen), steps_mean, steps_99}
export function read_feedback(words) {
  const wanted = new Map(), slots = new Set(), steps = [], distances = [], luminances = [];
  let coarse_pixels = 0, step_sum = 0;
  for (let at = 0; at < words.length; at += 4) {
    const missing = words[at], pair = words[at + 1];
    if (missing !== 0) {
      const pixels = half_to_number(pair & 0xffff);
      wanted.set(missing, (wanted.get(missing) || 0) + pixels);
      if (pixels > coarse_pixels) coarse_pixels = pixels;
    }
    const slot = words[at + 2] & 0x3fffff, count = words[at + 2] >>> 22 << 1;
    if (slot !== 0) slots.add(slot);
    steps.push(count);
    step_sum += count;
    if (words[at + 3] !== 0 || pair >>> 16 !== 0) {
      distances.push(bits_to_float(words[at + 3]));
      luminances.push(1e-3 + half_to_number(pair >>> 16));
    }
  }
  for (const list of [steps, distances, luminances]) list.sort((a, b) => a - b);
  return {wanted, slots, coarse_pixels, steps_mean: step_sum / Math.max(1, steps.length), steps_99: share_of(steps, 0.99),
          median_t: share_of(distances, 0.5), nearest_t: distances[0] || 0,
          exposure: luminances.length === 0 ? null
            : Math.min(0.42 / share_of(luminances, 0.5), 0.85 / share_of(luminances, 0.9))};
}
