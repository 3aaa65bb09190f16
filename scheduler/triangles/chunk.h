// Stored triangles: records of fixed size in chunks, each chunk in memory or in a TriangleFile.
// Both triangle stores use these chunks. The functions take no locks: one thread writes a list of
// chunks, and any number of threads may read the list when it is complete.
//
// A record has nine coordinates of 32 bits (36 bytes). If the build's options give the grid's
// bounds, triangles can extend far beyond the grid. Their coordinates then have 64 bits ("wide", 72
// bytes).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/backend/backend.h"
#include "scheduler/triangles/triangle_file.h"

namespace voxdag {

inline constexpr size_t kMaxTriangleRecordBytes = 72;
size_t triangle_record_bytes(bool wide);
// Writes the record of a triangle to `out`, which has room for `record_bytes` bytes.
void encode_triangle(const FixedTriangle& triangle, size_t record_bytes, std::byte* out);

struct Chunk {
  std::vector<std::byte> memory = {};  // empty if the records are in a file
  Extent extent = {};                  // position of the records in that file
  uint32_t records = 0;
  uint64_t first = 0;  // number of records in the list before this chunk
};

// Memory per entry of a growing list of chunks. A growing vector can have room for twice its
// entries.
inline constexpr uint64_t kChunkListBytes = 2 * sizeof(Chunk);

struct ChunkList {
  std::vector<Chunk> chunks;
  uint64_t records = 0;

  void add(Chunk chunk) {
    chunk.first = records;
    records += chunk.records;
    chunks.push_back(std::move(chunk));
  }
  // Sorts the chunks by their offsets in the file. No chunk may be in memory.
  void sort_by_offset();
};

// Streams the triangles of a complete list, starting at index `first`. Chunks that are not in
// memory are read from `file`; this can throw DamagedTriangles. The list and the file must outlive
// the stream.
std::unique_ptr<TriangleStream> open_chunks(const ChunkList& list, const TriangleFile* file,
                                            size_t record_bytes, uint64_t first);

// Frees the space in `file` of the chunks that are not in memory.
void release_chunks(const ChunkList& list, TriangleFile* file);

}  // namespace voxdag
