// This file is compiled for AVX2, so its functions may run only after a check that the CPU has
// AVX2.
#include "core/color/blocks/block_encoder.h"

namespace voxdag {
namespace {

struct Avx2Blocks {};

ColorBlock encode(const Color* colors, size_t count) {
  return BlockEncoder<Avx2Blocks>::encode(colors, count);
}

}  // namespace

EncodeBlock encode_block_avx2() { return __builtin_cpu_supports("avx2") ? encode : nullptr; }

}  // namespace voxdag
