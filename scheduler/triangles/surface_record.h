// Records of surfaces: snapped triangles with material, texture coordinates and colors. A spill
// file stores them until the color stage bakes them. A record has 41 to 149 bytes; records are
// stored one after another. A record omits data without influence on the color: texture coordinates
// of materials without an image, and COLOR_0 if all corners are white.
//
//     u8   flags: 1 wide positions, 2 textured, 4 wide texture coordinates, 8 colored, 16 flipped
//     u32  material
//     9 x  i32, or i64 if wide: positions, [vertex][axis]
//     6 x  i32, or i64 if wide: texture coordinates, [corner][axis], if textured
//     12 x u16: COLOR_0, [corner][channel], if colored
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/color/cutouts/cutouts.h"
#include "core/color/surface.h"
#include "core/format/bytes.h"
#include "scheduler/triangles/record_store.h"

namespace voxdag {

inline constexpr size_t kMaxSurfaceRecordBytes = 1 + 4 + 9 * 8 + 6 * 8 + 12 * 2;

// Appends the record of a surface. `has_image` is true if its material has a readable image.
void append_surface(const FixedSurface& surface, bool has_image, std::vector<std::byte>& out);

// Appends the data of a snapped triangle that decide which voxels it sets: its positions as a
// record of `record_bytes` bytes (chunk.h) and, if the triangle can be cut out, the record of its
// surface. `cutouts` may be null.
void append_identity(const FixedSurface& surface, const Cutouts* cutouts, size_t record_bytes,
                     std::vector<std::byte>& out);

// Reads the records in `bytes`, in the form that append_surface() writes. The caller has verified
// the checksum of the bytes.
class SurfaceRecords {
 public:
  explicit SurfaceRecords(std::span<const std::byte> bytes) : in_(bytes) {}
  // Returns the next surface; nullopt after the last one. Fields omitted from the record are 0 or
  // white. Throws DamagedTriangles for bytes that are not a record.
  std::optional<FixedSurface> next();

 private:
  ByteSource in_;
  uint64_t count_ = 0;
};

// Writes surface records to the lists of a store. The incomplete chunks of all lists take at most
// about `buffer_bytes`. The references must outlive the writer.
ChunkWriter surface_writer(RecordStore& store, std::span<ChunkList> lists, size_t buffer_bytes);

// Calls visit(surface) for each surface of a list. Throws DamagedTriangles.
template <class Visit>
void for_each_surface(const RecordStore& store, const ChunkList& list, const Visit& visit) {
  std::vector<std::byte> buffer;
  for (const Chunk& chunk : list.chunks) {
    SurfaceRecords records(store.read(chunk, buffer));
    while (const auto surface = records.next()) visit(*surface);
  }
}

}  // namespace voxdag
