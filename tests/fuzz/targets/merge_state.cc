// Decodes the state that an interrupted merge stores. The target corrects the checksum. The
// encoding of a decoded state must have the same bytes as the input.
#include "merge/checkpoint/merge_state.h"

#include <algorithm>

#include "core/base/error.h"
#include "tests/fuzz/support/fuzz_target.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag;
  const auto bytes = fuzz::with_checksum(fuzz::bytes_of(data, size));
  try {
    fuzz::require(std::ranges::equal(encode_state(decode_state(bytes)), bytes),
                  "a state that was decoded is encoded to the same bytes");
  } catch (const Error& error) {
    fuzz::require(error.code() == ErrorCode::kCorrupt, "a bad state is an error of kind corrupt");
  }
  return 0;
}
