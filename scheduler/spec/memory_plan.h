// How a build divides its memory budget (--memory). The table lists every fraction of the budget,
// or the struct that defines the fraction. A part is *charged* if a MemoryBudget counts it. The
// last column names the class or stage that requests the memory.
//
//   stage         part                              size                         charged by
//   ------------  --------------------------------  ---------------------------  -------------
//   scan, ingest  vertices of an indexed mesh       up to 1/4 of free            VertexCache
//                 top tree                          up to 1/16                   TopTree
//   ingest until  triangles; the rest is spilled    up to 1/3                    TriangleStore
//   built
//                 cursors and pieces of the scene   1/2 of free                  each part
//                   lists of touched cells, cubes   up to 3 MiB each             nobody
//   partition     half-filled chunks of triangles   1/8                          nobody
//   rows          sample rows of a solid's subvolume,
//                 for every thread                  1/64 each, up to 1/2 of free RowSums
//                   columns of sample rows          up to 3/2 of the row above   RowColumn
//   estimate      pilot builds, consecutive         3/4 of free                  Backend
//   build         WorkerMemory, for every worker    free / workers
//                   segment writer                  1.5 MiB                      SegmentWriter
//                   pages that a backend retains    8 MiB                        nobody
//                   half-filled chunks of a split   512 KiB                      nobody
//                   share of Backend::build()       the rest                     Backend
//                     sample rows of a solid        twice 1/64 of the budget     executor
//                     tables made in advance        1/4 of its free part         BackendMemory
//                     each table of the plane memo  1/16 of the share,           BackendMemory
//                                                     at most 1/8 of free
//                     block memo                    1/16 of free                 BackendMemory
//                     more retained pages           1/8, up to 512 MiB           nobody
//                     cache key, before build()     7/8 of the share             ArtifactCache
//   enclose       kept labels of parts              kept_label_bytes()           SpaceLabels
//                 WorkerMemory, for every worker    7/8 of the rest / workers
//                   segment writer                  1.5 MiB                      SegmentWriter
//                   labels of a part                1/3 of the share; 1/2 for    SpaceLabels
//                                                     parts of the smallest edge
//                   tables of a part being filled   the share                    SubDagTables
//                   quadtree of a face              1/16 of the share            nobody
//                 components at all faces           the rest                     ComponentSets
//   enclose with a radius: also find_blocked() and find_enclosed() (cube_walks.h)
//                 cubes of the artifacts            any                          ArtifactTree
//                 WorkerMemory, for every worker    7/8 of the rest / workers
//                   segment writer                  1.5 MiB                      SegmentWriter
//                   nodes around a part, tables     the share                    add_blocked(),
//                     of its results                                             add_enclosed()
//   color         surfaces; the rest is spilled     up to 1/3 of free            RecordStore
//                   incomplete chunks of surfaces   1/8 of the budget            nobody
//                 textures, or else spilled         up to 1/2 of the rest        TextureSet
//                 ColorMemory, for every worker     7/8 of free / workers
//                   a region, and the encoded       1/2, 12 to 50 MiB            CubeBaker
//                     regions of its cube
//                   other attributes of a region    16 MiB or more, if any       CubeBaker
//                   surfaces of a cube              2/3 of the rest              CubeBaker
//                   pages of textures               1/3 of the rest              TextureReader
//   merge         MergeMemory, of free
//                   workers, together               1/4                          merge
//                   positions of two levels         1/6 for each; then spilled   merge
//                   hash partition                  the rest, less 1/16, up to   merge
//                                                   the useful size (LevelRows)
//
// "Free" is the part of the budget still available when a stage allocates. A fraction without "of"
// is a fraction of the budget, or, in an indented row, of the part above. "The rest" is the memory
// left by the rows above. The color stage leaves 1/8 of its free memory for the directories and
// coarser levels of the attribute sections, which AttributeSectionWriter charges. Two kinds of
// memory are not charged: the parts marked "nobody" above, and lists that grow with the number of
// subvolumes and frames. These lists are the artifact indexes of one merge pass (56 bytes per
// frame; the hash partition leaves 1/16 of the budget for them) and the chunk lists of spilled
// triangles.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/backend/backend.h"
#include "core/backend/backend_memory.h"
#include "core/color/attribute_set.h"
#include "core/format/artifact/segment_writer.h"

namespace voxdag {

struct MemoryPlan {
  // Memory of one thread that reads the scene: the windows and batches of its TriangleCursor, a
  // piece of the scene, and the piece's counts for the top tree. The vertices of indexed meshes are
  // not included (first row of the table).
  static constexpr uint64_t kIngestWorkerBytes = uint64_t{6} << 20;
  // Memory of half-filled chunks while a subvolume is split. It is not charged.
  static constexpr uint64_t kSplitBufferBytes = uint64_t{512} << 10;

  uint64_t top_tree_bytes = 0;          // counters of the top tree
  uint64_t triangle_bytes = 0;          // triangles in memory, until their subvolumes are built
  uint64_t partition_buffer_bytes = 0;  // chunks being filled, all subvolumes together; uncharged

  static constexpr MemoryPlan divide(uint64_t budget_bytes) {
    return {budget_bytes / 16, budget_bytes / 3, budget_bytes / 8};
  }
  // Returns the number of threads that can read the scene with `free_bytes` of memory.
  static constexpr uint64_t ingest_workers(uint64_t free_bytes) {
    return std::max<uint64_t>(free_bytes / 2 / kIngestWorkerBytes, 1);
  }
  // A thread that reads or partitions the scene processes at least this many pieces. Fewer pieces
  // take a few milliseconds, so they are not worth the memory and the start of another thread.
  static constexpr uint64_t kMinPiecesPerThread = 4;
  // Returns the number of reading threads: at most `threads`, at most one per piece, and at most
  // ingest_workers(free_bytes).
  static constexpr unsigned ingest_threads(uint64_t pieces, uint64_t free_bytes, unsigned threads) {
    return static_cast<unsigned>(
        std::clamp<uint64_t>(std::min(pieces, ingest_workers(free_bytes)), 1, threads));
  }
  // Returns the maximum size of the sample rows of a solid's planned subvolume.
  static constexpr uint64_t solid_row_bytes(uint64_t budget_bytes) { return budget_bytes / 64; }
  // Returns the memory for labels of empty space (SpaceLabels) that the stage `enclose` keeps until
  // it fills their parts. If little memory is free, no labels are kept, so that the workers can
  // process large parts.
  static constexpr uint64_t kept_label_bytes(uint64_t free_bytes) {
    return free_bytes < uint64_t{512} << 20 ? 0 : free_bytes / 2;
  }
  // Returns the budget of a pilot build when `free_bytes` are free.
  static constexpr uint64_t pilot_bytes(uint64_t free_bytes) { return free_bytes * 3 / 4; }
};

// Memory of the workers of the color stage.
struct ColorMemory {
  // Memory for baking one region of the color grid. kRegionBytes is the minimum; with it, a large
  // region is baked in pieces. kSolidRegionBytes is enough to bake any region in one piece.
  static constexpr uint64_t kRegionBytes = uint64_t{12} << 20;
  static constexpr uint64_t kSolidRegionBytes = uint64_t{50} << 20;
  // Memory for the attributes other than color in a region. Includes kValueSumBytes for the sums of
  // their values. Larger sums are charged in addition (CubeBaker).
  static constexpr uint64_t kValueBytes = uint64_t{16} << 20;
  static constexpr uint64_t kValueSumBytes = uint64_t{4} << 20;

  static constexpr uint64_t value_bytes(const AttributeSet& attributes) {
    return attributes.without(Attribute::kColor).any() ? kValueBytes : 0;
  }

  unsigned workers = 1;
  uint64_t region_bytes = kRegionBytes;  // bytes per worker
  uint64_t surface_bytes = 0;
  uint64_t texture_bytes = 0;

  // Divides 7/8 of the free memory among at most `wanted` workers. The directories of the attribute
  // sections need the remaining 1/8.
  static constexpr ColorMemory divide(uint64_t free_bytes, unsigned wanted,
                                      const AttributeSet& attributes) {
    const uint64_t bytes = free_bytes - free_bytes / 8,
                   least = kRegionBytes + value_bytes(attributes);
    const auto workers =
        static_cast<unsigned>(std::clamp<uint64_t>(bytes / (2 * least), 1, wanted));
    const uint64_t each = bytes / workers;
    const uint64_t region = std::clamp(each / 2, kRegionBytes, kSolidRegionBytes);
    const uint64_t rest = each - std::min(each, region + value_bytes(attributes));
    return {workers, region, rest / 3 * 2, rest / 3};
  }
};

// Memory of the workers of the build stage.
struct WorkerMemory {
  // Maximum number of workers. It is limited because every worker has a segment file open.
  static constexpr uint64_t kMaxWorkers = 256;
  // Memory that one worker needs in addition to share_bytes.
  static constexpr uint64_t kOutsideShareBytes = kSegmentWriterBytes + BackendMemory::kMinPageBytes;

  unsigned workers = 1;
  uint64_t share_bytes = 0;  // bytes per worker for Backend::build()

  // Returns `wanted` workers, at most kMaxWorkers. Returns fewer, but at least one, if their shares
  // could not hold the smallest subvolume.
  static constexpr WorkerMemory divide(uint64_t free_bytes, unsigned wanted) {
    constexpr uint64_t kMinBytes = kSmallestBudget + kOutsideShareBytes;
    const uint64_t workers =
        std::clamp<uint64_t>(free_bytes / kMinBytes, 1, std::min<uint64_t>(wanted, kMaxWorkers));
    const uint64_t each = free_bytes / workers;
    return {static_cast<unsigned>(workers), each - std::min(each, kOutsideShareBytes)};
  }
  // Returns the part of a worker's share that may be used to compute a subvolume's cache key. The
  // pages that the backend retains take the rest of the share.
  static constexpr uint64_t key_bytes(uint64_t share_bytes) { return share_bytes / 8 * 7; }
};

}  // namespace voxdag
