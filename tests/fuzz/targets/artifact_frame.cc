// Decodes a frame of an artifact (a compressed block of rows of one level). The first byte of the
// input selects bricks or nodes, and the number of hash bits. The next four bytes give the numbers
// of rows and children, which an artifact stores in its index. The rest is the frame.
#include "core/dag/sub_dag.h"
#include "core/format/artifact/artifact.h"
#include "core/format/artifact/frame_codec.h"
#include "core/format/artifact/row_order.h"
#include "tests/fuzz/support/fuzz_target.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag;
  constexpr size_t kPrefixBytes = 5;
  if (size < kPrefixBytes) return 0;
  const bool bricks = data[0] & 1;
  const uint32_t hash_bits = 4 + (data[0] >> 1) % 61;
  const uint32_t rows = 1 + (data[1] | data[2] << 8) % kFrameRows;
  const uint32_t children = rows + (data[3] | data[4] << 8) % (7 * rows + 1);
  const auto bytes = fuzz::bytes_of(data, size).subspan(kPrefixBytes);
  static Frame frame;
  LastRow last;
  if (bricks) {
    if (decode_brick_frame(bytes, rows, hash_bits, frame)) return 0;
    fuzz::require(frame.brick_masks.size() >= rows && frame.hashes.size() >= rows,
                  "a decoded frame has all rows");
    check_brick_order(std::span(frame.hashes).first(rows), std::span(frame.brick_masks).first(rows),
                      last);
  } else {
    if (decode_node_frame(bytes, rows, children, frame)) return 0;
    fuzz::require(frame.masks.size() >= rows && frame.hashes.size() >= rows &&
                      frame.children.size() >= children,
                  "a decoded frame has all rows and children");
    NodeLevelView view;
    view.hashes = std::span(frame.hashes).first(rows);
    view.masks = std::span(frame.masks).first(rows);
    view.children = std::span(frame.children).first(children);
    check_node_order(view, uint64_t{1} << 32, hash_bits, last);
  }
  return 0;
}
