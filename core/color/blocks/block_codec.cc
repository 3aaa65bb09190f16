#include "core/color/blocks/block_codec.h"

#include "core/color/blocks/block_encoder.h"

namespace voxdag {
namespace {

struct PortableBlocks {};

}  // namespace

ColorBlock encode_block_portable(const Color* colors, size_t count) {
  return BlockEncoder<PortableBlocks>::encode(colors, count);
}

#ifndef __x86_64__
EncodeBlock encode_block_avx2() { return nullptr; }
#endif

EncodeBlock fastest_block_encoder() {
  static const EncodeBlock avx2 = encode_block_avx2();
  return avx2 ? avx2 : encode_block_portable;
}

}  // namespace voxdag
