#include "scheduler/triangles/surface_record.h"

#include <algorithm>
#include <limits>
#include <string>

#include "scheduler/triangles/chunk.h"
#include "scheduler/triangles/triangle_file.h"

namespace voxdag {
namespace {

constexpr uint8_t kWidePosition = 1, kTextured = 2, kWideTexture = 4, kColored = 8, kFlipped = 16;

bool fits_narrow(int64_t value) {
  return value >= std::numeric_limits<int32_t>::min() &&
         value <= std::numeric_limits<int32_t>::max();
}

uint8_t flags_of(const FixedSurface& surface, bool has_image) {
  uint8_t flags = (has_image ? kTextured : 0) | (surface.is_flipped ? kFlipped : 0);
  for (const auto& vertex : surface.position.v)
    if (!std::ranges::all_of(vertex, fits_narrow)) flags |= kWidePosition;
  for (const SurfaceCorner& corner : surface.corners) {
    if (has_image && !std::ranges::all_of(corner.texture, fits_narrow)) flags |= kWideTexture;
    if (corner.color != SurfaceCorner{}.color) flags |= kColored;
  }
  return flags;
}

void put_coordinate(ByteSink& sink, int64_t value, bool is_wide) {
  if (is_wide)
    sink.put(value);
  else
    sink.put(static_cast<int32_t>(value));
}

int64_t get_coordinate(ByteSource& in, bool is_wide) {
  return is_wide ? in.get<int64_t>() : in.get<int32_t>();
}

}  // namespace

void append_surface(const FixedSurface& surface, bool has_image, std::vector<std::byte>& out) {
  const uint8_t flags = flags_of(surface, has_image);
  ByteSink sink(out);
  sink.put(flags);
  sink.put(surface.material);
  for (const auto& vertex : surface.position.v)
    for (const int64_t value : vertex) put_coordinate(sink, value, flags & kWidePosition);
  if (flags & kTextured)
    for (const SurfaceCorner& corner : surface.corners)
      for (const int64_t value : corner.texture) put_coordinate(sink, value, flags & kWideTexture);
  if (flags & kColored)
    for (const SurfaceCorner& corner : surface.corners)
      for (const uint16_t value : corner.color) sink.put(value);
}

void append_identity(const FixedSurface& surface, const Cutouts* cutouts, size_t record_bytes,
                     std::vector<std::byte>& out) {
  const size_t at = out.size();
  out.resize(at + record_bytes);
  encode_triangle(surface.position, record_bytes, out.data() + at);
  if (cutouts && cutouts->may_cut(surface.material)) append_surface(surface, true, out);
}

std::optional<FixedSurface> SurfaceRecords::next() {
  if (in_.ok() && in_.left() == 0) return std::nullopt;
  const uint8_t flags = in_.get<uint8_t>();
  if (flags >= 2 * kFlipped)
    throw DamagedTriangles("record " + std::to_string(count_) +
                           " of the stored triangles has the flags " + std::to_string(flags) +
                           ": expected at most " + std::to_string(2 * kFlipped - 1));
  FixedSurface surface;
  surface.is_flipped = (flags & kFlipped) != 0;
  surface.material = in_.get<uint32_t>();
  for (auto& vertex : surface.position.v)
    for (int64_t& value : vertex) value = get_coordinate(in_, flags & kWidePosition);
  if (flags & kTextured)
    for (SurfaceCorner& corner : surface.corners)
      for (int64_t& value : corner.texture) value = get_coordinate(in_, flags & kWideTexture);
  if (flags & kColored)
    for (SurfaceCorner& corner : surface.corners)
      for (uint16_t& value : corner.color) value = in_.get<uint16_t>();
  if (!in_.ok())
    throw DamagedTriangles("record " + std::to_string(count_) +
                           " of the stored triangles is cut off: expected a complete record");
  ++count_;
  return surface;
}

ChunkWriter surface_writer(RecordStore& store, std::span<ChunkList> lists, size_t buffer_bytes) {
  const size_t chunk_bytes = std::clamp<size_t>(buffer_bytes / lists.size(), 2048, 64 << 10);
  return ChunkWriter(lists.size(), chunk_bytes,
                     [&store, lists](size_t list, std::span<const std::byte> records,
                                     uint32_t count) { store.add(lists[list], records, count); });
}

}  // namespace voxdag
