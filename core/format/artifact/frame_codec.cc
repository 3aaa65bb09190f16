#include "core/format/artifact/frame_codec.h"

#include <zstd.h>

#include <algorithm>
#include <new>

#include "core/base/error.h"
#include "core/dag/node_hash.h"
#include "core/format/bytes.h"

namespace voxdag {
namespace {

// Compression level. With level 1, artifacts would be an eighth smaller, but builds 5 % slower.
constexpr int kZstdLevel = -1;
constexpr uint32_t kCompressedFlag = 0x80000000u;
// If compression reduces a column of a frame by less than a quarter, the same column is stored
// uncompressed in this many following frames, to save time.
constexpr uint32_t kFramesToSkip = 15;
constexpr size_t kBrickColumn = 0, kMaskColumn = 1;

// Writes byte `plane` of each value to `out`; byte 0 is the lowest.
template <class T>
void extract_plane(std::span<const T> values, unsigned plane, std::byte* out) {
  const unsigned shift = 8 * plane;
  for (size_t i = 0; i < values.size(); ++i) out[i] = static_cast<std::byte>(values[i] >> shift);
}

template <class T>
void add_plane(const std::byte* plane_bytes, unsigned plane, std::span<T> values) {
  const unsigned shift = 8 * plane;
  if (plane == 0)
    for (size_t i = 0; i < values.size(); ++i) values[i] = static_cast<T>(plane_bytes[i]);
  else
    for (size_t i = 0; i < values.size(); ++i) values[i] |= static_cast<T>(plane_bytes[i]) << shift;
}

uint32_t plane_count(std::span<const uint32_t> children) {
  uint32_t all = 0;
  for (const uint32_t child : children) all |= child;
  return all > 0xffffff ? 4 : all > 0xffff ? 3 : all > 0xff ? 2 : 1;
}

// Returns this thread's decompression context. Several threads read frames concurrently, but zstd
// cannot use one context in two threads at the same time.
ZSTD_DCtx* decompression_context() {
  struct Deleter {
    void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
  };
  thread_local const std::unique_ptr<ZSTD_DCtx, Deleter> context(ZSTD_createDCtx());
  if (!context) throw std::bad_alloc();
  return context.get();
}

// Takes a column from `source` and returns its `expected` bytes: in place if they are stored
// uncompressed, otherwise decompressed into `buffer`. Returns an empty span if the column does not
// have `expected` bytes.
std::span<const std::byte> take_column(ByteSource& source, size_t expected,
                                       std::vector<std::byte>& buffer) {
  const uint32_t head = source.get<uint32_t>();
  const auto stored = source.take(head & ~kCompressedFlag);
  if (!(head & kCompressedFlag))
    return stored.size() == expected ? stored : std::span<const std::byte>();
  buffer.resize(expected);
  const size_t size = ZSTD_decompressDCtx(decompression_context(), buffer.data(), buffer.size(),
                                          stored.data(), stored.size());
  return size == expected ? buffer : std::span<const std::byte>();
}

}  // namespace

struct FrameEncoder::Context {
  ZSTD_CCtx* zstd = ZSTD_createCCtx();
  ~Context() { ZSTD_freeCCtx(zstd); }
};

FrameEncoder::FrameEncoder() : context_(std::make_unique<Context>()) {
  if (!context_->zstd) throw std::bad_alloc();
}

FrameEncoder::~FrameEncoder() = default;

void FrameEncoder::put_column(size_t column, std::span<const std::byte> bytes) {
  ByteSink sink(out_);
  uint32_t& to_skip = frames_to_skip_[column];
  if (to_skip == 0) {
    const size_t head = out_.size();
    out_.resize(head + sizeof(uint32_t) + ZSTD_compressBound(bytes.size()));
    std::byte* const target = out_.data() + head + sizeof(uint32_t);
    const size_t size = ZSTD_compressCCtx(context_->zstd, target, ZSTD_compressBound(bytes.size()),
                                          bytes.data(), bytes.size(), kZstdLevel);
    if (!ZSTD_isError(size) && size <= bytes.size() - bytes.size() / 4) {
      const uint32_t stored = static_cast<uint32_t>(size) | kCompressedFlag;
      std::memcpy(out_.data() + head, &stored, sizeof(stored));
      out_.resize(head + sizeof(stored) + size);
      return;
    }
    out_.resize(head);
    to_skip = kFramesToSkip;
  } else {
    --to_skip;
  }
  sink.put(static_cast<uint32_t>(bytes.size()));
  sink.put_bytes(bytes);
}

std::span<const std::byte> FrameEncoder::encode_bricks(std::span<const uint64_t> masks) {
  out_.clear();
  planes_.resize(masks.size() * sizeof(uint64_t));
  for (unsigned plane = 0; plane < sizeof(uint64_t); ++plane)
    extract_plane(masks, plane, planes_.data() + plane * masks.size());
  put_column(kBrickColumn, planes_);
  return out_;
}

std::span<const std::byte> FrameEncoder::encode_nodes(const NodeLevelView& rows) {
  out_.clear();
  ByteSink sink(out_);
  const uint32_t planes = plane_count(rows.children);
  sink.put(planes);
  sink.put_bytes(std::as_bytes(rows.hashes));
  put_column(kMaskColumn, std::as_bytes(rows.masks));
  planes_.resize(rows.children.size());
  extract_plane(rows.children, 0, planes_.data());
  sink.put(static_cast<uint32_t>(planes_.size()));
  sink.put_bytes(planes_);
  for (unsigned plane = 1; plane < planes; ++plane) {
    extract_plane(rows.children, plane, planes_.data());
    put_column(kMaskColumn + plane, planes_);
  }
  return out_;
}

const char* decode_brick_frame(std::span<const std::byte> bytes, uint32_t rows, uint32_t hash_bits,
                               Frame& out) {
  ByteSource source(bytes);
  const auto planes = take_column(source, rows * sizeof(uint64_t), out.planes);
  if (planes.empty() || source.left() != 0) return "the brick column is incomplete";
  out.rows = rows;
  out.masks.clear();
  out.children.clear();
  out.brick_masks.resize(rows);
  for (unsigned plane = 0; plane < sizeof(uint64_t); ++plane)
    add_plane(planes.data() + plane * rows, plane, std::span(out.brick_masks));
  out.hashes.resize(rows);
  for (uint32_t i = 0; i < rows; ++i)
    out.hashes[i] = truncate_hash(hash_brick(out.brick_masks[i]), hash_bits);
  return nullptr;
}

const char* decode_node_frame(std::span<const std::byte> bytes, uint32_t rows, uint32_t children,
                              Frame& out) {
  ByteSource source(bytes);
  const uint32_t planes = source.get<uint32_t>();
  if (planes < 1 || planes > sizeof(uint32_t)) return "its child indices do not have 1 to 4 bytes";
  const auto hashes = source.take(rows * sizeof(uint64_t));
  if (hashes.empty()) return "the hash column is incomplete";
  out.rows = rows;
  out.brick_masks.clear();
  out.hashes.resize(rows);
  std::memcpy(out.hashes.data(), hashes.data(), hashes.size());
  const auto masks = take_column(source, rows, out.planes);
  if (masks.empty()) return "the mask column is incomplete";
  out.masks.resize(rows);
  std::memcpy(out.masks.data(), masks.data(), masks.size());
  out.children.resize(children);
  for (unsigned plane = 0; plane < planes; ++plane) {
    const auto column = take_column(source, children, out.planes);
    if (column.empty()) return "a child column is incomplete";
    add_plane(column.data(), plane, std::span(out.children));
  }
  return source.left() == 0 ? nullptr : "bytes follow the last column";
}

}  // namespace voxdag
