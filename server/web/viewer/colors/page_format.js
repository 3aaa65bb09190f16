// Checks a color page (docs/format.md) and lays its words out for the GPU. Pages come from the
// network: a damaged one is an error and never a wrong address.

export const kBlockWords = 64;  // of the pool: 16 texels of four words
const kMaskAt = 1, kMaskWords = 16;
const kSingle = 1 << 24;       // of a page's first word: colors follow one by one, not in blocks
const kUsedBits = 0x011f03ff;  // of the same
const kFirstColors = 8;        // texels of colors in the first block
export const kMoreAt = 20;     // word of the first block where the addresses of the others begin

function countBits(word) {
  let bits = 0;
  for (; word; word &= word - 1) ++bits;
  return bits;
}

// The first block of the pool has the page's first word, how many cells come before the second,
// third and fourth 128 of them (10 bits each), two words of 0, the mask, the addresses of up to 12
// more blocks, and 8 texels of colors; the others have 16. Returns the words of whole blocks,
// without these addresses; none for a page without cells.
export function decodePage(page) {
  const count = page[0] & 1023, skip = page[0] >>> 16 & 31, single = (page[0] & kSingle) !== 0;
  if (page.length === 1 && page[0] === 0) return new Uint32Array(0);
  const colors = single ? count : Math.ceil((skip + count) / 32) * 4;
  if (count < 1 || count > 512 || (single && skip > 0) || (page[0] & ~kUsedBits) !== 0 ||
      page.length !== kMaskAt + kMaskWords + colors)
    throw new Error(`A color page has ${page.length} words, and ${count} cells.`);
  const mask = page.subarray(kMaskAt, kMaskAt + kMaskWords), before = [0];
  for (const [i, word] of mask.entries()) before.push(before[i] + countBits(word));
  if (before[kMaskWords] !== count)
    throw new Error("The mask of a color page has another number of cells.");
  const further = Math.max(0, Math.ceil(colors / 4) - kFirstColors);
  const words = new Uint32Array(kBlockWords * (1 + Math.ceil(further / 16)));
  words.set([page[0], before[4] | before[8] << 10 | before[12] << 20]);
  words.set(mask, 4);
  words.set(page.subarray(kMaskAt + kMaskWords), 4 * kFirstColors);
  return words;
}
