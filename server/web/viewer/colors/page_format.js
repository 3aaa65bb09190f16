// Checks a color page (docs/format.md) and lays out its words for the GPU. Pages come from the
// network: a damaged page is an error, never a wrong address.

export const kBlockWords = 64;  // words per block of the pool: 16 texels of four words
const kMaskAt = 1, kMaskWords = 16;
const kSingle = 1 << 24;       // flag of a page's first word: single colors follow, not blocks
const kUsedBits = 0x011f03ff;  // all valid bits of the first word
const kFirstColors = 8;        // color texels in the first block
// Index in the first block's words at which the addresses of the other blocks begin.
export const kMoreAt = 20;

function countBits(word) {
  let bits = 0;
  for (; word; word &= word - 1) ++bits;
  return bits;
}

// Returns the words of complete blocks; no words for a page without cells. The first block begins
// with the page's first word. The second word has three numbers of 10 bits: the number of occupied
// cells before the second, the third and the fourth group of 128 cells. Then follow two words of 0,
// the mask, the addresses of up to 12 more blocks (filled in later), and 8 texels of colors. Each
// other block has 16 texels of colors.
export function decodePage(page) {
  const count = page[0] & 1023, skip = page[0] >>> 16 & 31, single = (page[0] & kSingle) !== 0;
  if (page.length === 1 && page[0] === 0) return new Uint32Array(0);
  const colors = single ? count : Math.ceil((skip + count) / 32) * 4;
  if (count < 1 || count > 512 || (single && skip > 0) || (page[0] & ~kUsedBits) !== 0 ||
      page.length !== kMaskAt + kMaskWords + colors)
    throw new Error(
        `A color page has ${page.length} words; its first word is ${page[0]?.toString(16)}.`);
  const mask = page.subarray(kMaskAt, kMaskAt + kMaskWords), before = [0];
  for (const [i, word] of mask.entries()) before.push(before[i] + countBits(word));
  if (before[kMaskWords] !== count)
    throw new Error(`The mask of a color page has ${before[kMaskWords]} cells; expected ${count}.`);
  const further = Math.max(0, Math.ceil(colors / 4) - kFirstColors);
  const words = new Uint32Array(kBlockWords * (1 + Math.ceil(further / 16)));
  words.set([page[0], before[4] | before[8] << 10 | before[12] << 20]);
  words.set(mask, 4);
  words.set(page.subarray(kMaskAt + kMaskWords), 4 * kFirstColors);
  return words;
}
