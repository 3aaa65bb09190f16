// The index of an artifact, with corrected checksum and position. A decoded index obeys the format,
// so that encoding it gives the same bytes.
#include "core/format/artifact/artifact_index.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "tests/fuzz/targets/fuzz_target.h"

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
    fuzz::require(std::ranges::equal(encode_index(index), bytes),
                  "an index that was decoded is encoded to the same bytes");
  } catch (const Error&) {
  }
  return 0;
}
