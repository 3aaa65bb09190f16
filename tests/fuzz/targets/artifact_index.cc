// Decodes the index of an artifact. The target computes the checksum and the position of the index
// from the input, so that a mutation reaches the code after these checks. The encoding of a decoded
// index must have the same bytes as the input.
#include "core/format/artifact/artifact_index.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "tests/fuzz/support/fuzz_target.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag;
  constexpr size_t kFrameBytesAt = 32;  // the field that counts the bytes of all frames
  const auto bytes = fuzz::bytes_of(data, size);
  uint64_t frame_bytes = 0;
  if (size >= kFrameBytesAt + sizeof frame_bytes)
    std::copy_n(data + kFrameBytesAt, sizeof frame_bytes, reinterpret_cast<uint8_t*>(&frame_bytes));
  ArtifactRef ref{.segment = 1, .offset = kSegmentHeaderBytes};
  ref.index_offset = ref.offset + frame_bytes;
  ref.bytes = frame_bytes + size;
  ref.checksum = checksum64(bytes);
  try {
    const ArtifactIndex index = decode_index(bytes, ref, "input");
    fuzz::require(std::ranges::equal(encode_index(index, "fuzz"), bytes),
                  "an index that was decoded is encoded to the same bytes");
  } catch (const Error&) {
  }
  return 0;
}
