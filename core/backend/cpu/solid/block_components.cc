#include "core/backend/cpu/solid/block_components.h"

namespace voxdag::cpu {
namespace {

constexpr uint64_t kLowZ = 0x0101010101010101ull;  // voxels with z = 0

// Exchanges bit `word_bit` of the words' numbers with the bit of the voxels' numbers whose value is
// `shift`. `low`: the voxels with that bit 0.
void exchange_words(uint64_t (&words)[8], int word_bit, int shift, uint64_t low) {
  for (int w = 0; w < 8; ++w) {
    if (w & word_bit) continue;
    uint64_t& a = words[w];
    uint64_t& b = words[w | word_bit];
    const uint64_t differ = ((a >> shift) ^ b) & low;
    a ^= differ << shift;
    b ^= differ;
  }
}

// A voxel's number (word | bit) has the bits x2 y2 z2 | x1 y1 z1 x0 y0 z0 in Morton order, and x2
// x1 x0 | y2 y1 y0 z2 z1 z0 in slices. Three exchanges of two bits each turn one order into the
// other, so the function is its own inverse.
void exchange_order(uint64_t (&words)[8]) {
  exchange_words(words, 2, 32, 0x00000000ffffffffull);  // y2 and x1
  exchange_words(words, 1, 4, 0x0f0f0f0f0f0f0f0full);   // z2 and x0
  for (uint64_t& word : words) {                        // z1 and y0
    const uint64_t differ = (word >> 6 ^ word) & 0x00cc00cc00cc00ccull;
    word ^= differ ^ differ << 6;
  }
}

// Extends `reached` along lines of eight voxels, whose bits are kStep apart, in both directions.
// `up_free` and `down_free`: voxels that a step upward or downward may reach.
template <int kStep>
void fill_lines(uint64_t& reached, uint64_t up_free, uint64_t down_free) {
  uint64_t up = reached, down = reached;
  for (int step = kStep; step < 8 * kStep; step *= 2) {
    up |= up_free & up << step;
    up_free &= up_free << step;
    down |= down_free & down >> step;
    down_free &= down_free >> step;
  }
  reached = up | down;
}

// Extends `reached` along z and y, in both directions, as far as `empty` goes.
void fill_slice(uint64_t& reached, uint64_t empty) {
  fill_lines<1>(reached, empty & ~kLowZ, empty & ~(kLowZ << 7));
  fill_lines<8>(reached, empty, empty);
}

}  // namespace

Slices slices_of(const VoxelBlock& block) {
  Slices out;
  for (int i = 0; i < 8; ++i) out.x[i] = block.bricks[i];
  exchange_order(out.x);
  return out;
}

VoxelBlock block_of(const Slices& slices) {
  VoxelBlock out;
  for (int i = 0; i < 8; ++i) out.bricks[i] = slices.x[i];
  exchange_order(out.bricks);
  return out;
}

Slices flood(const Slices& seeds, const Slices& empty) {
  Slices reached = seeds;
  while (true) {
    const Slices before = reached;
    for (int i = 1; i < 8; ++i) reached.x[i] |= reached.x[i - 1] & empty.x[i];
    for (int i = 7; i-- > 0;) reached.x[i] |= reached.x[i + 1] & empty.x[i];
    for (int i = 0; i < 8; ++i) fill_slice(reached.x[i], empty.x[i]);
    if (reached == before || reached == empty) return reached;
  }
}

}  // namespace voxdag::cpu
