// The input of a cluster task: its subvolumes and their triangles, in one write-once file.
//
//   "vdbatch3"  u64 size of the header in bytes  u64 XXH64 of the header  header (JSON)
//   for each subvolume, in order:
//     chunks of records: u64 XXH64 of the records  up to kBatchChunkRecords records (chunk.h)
//     solids only: compressed views along x, y and z (solid_rows.h)
//
// All chunks of a subvolume but the last are full. The header has the sizes and checksums of the
// views.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/dag/sub_dag.h"
#include "core/geometry/cube.h"
#include "core/geometry/voxel_rule.h"
#include "core/io/file_system.h"
#include "scheduler/solid/solid_rows.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/state/job_store.h"
#include "scheduler/triangles/memory_store.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

inline constexpr uint64_t kBatchChunkRecords = 1024;

struct BatchSubvolume {
  SubvolumeId id = 0;
  Cube cube;
  double weight = 0;
  uint64_t triangles = 0;
  // Only for solids: the state of the subvolume, and the extents of its views along x, y and z in
  // the file of the rows (SolidRows::file()). The batch file stores only the sizes and checksums of
  // the extents, not their offsets.
  SolidUnit unit = SolidUnit::kShell;
  std::vector<RowExtent> views;
};

struct Batch {
  uint32_t number = 0;
  std::string program;  // voxdag version that wrote the file; no other version may build it
  std::string build;    // random id of the build
  DagShape shape;
  VoxelRule rule = VoxelRule::kShell;
  SolidRule solid = SolidRule::kNone;
  bool wide = false;  // records have 64 bits per coordinate
  BackendName backend = BackendName::kAuto;
  MethodName method = MethodName::kDefault;
  int64_t longest_edge = INT64_MAX;        // max edge of a subvolume, in voxels
  std::vector<BatchSubvolume> subvolumes;  // in Morton order

  double weight() const;
};

// Writes the file, and makes it durable under its name. open(i) must return the triangles of
// batch.subvolumes[i]. `rows`: the file of the solid's rows; null if the build is not a solid.
// Throws DamagedTriangles if open(i) returns fewer triangles than expected, and Error{kCorrupt} for
// damaged rows.
void write_batch(FileSystem& files, const std::string& path, const Batch& batch,
                 const std::function<std::unique_ptr<TriangleStream>(size_t)>& open,
                 const RowFile* rows, const CancelToken& cancel);

class BatchFile {
 public:
  // Throws Error{kCorrupt} or Error{kUnsupportedVersion}.
  BatchFile(FileSystem& files, const std::string& path);

  const Batch& batch() const { return batch_; }
  // Adds the triangles to a store and returns the bin of each subvolume. If `rows` is not null,
  // also adds the rows of each subvolume to `rows`. Throws Error{kCorrupt} if records or rows do
  // not match their checksum.
  std::vector<BinId> copy_to(TriangleStore& store, SolidRows* rows,
                             const CancelToken& cancel) const;

 private:
  // Both functions return the offset of the byte after the data that they read.
  uint64_t copy_triangles(uint64_t offset, uint64_t count, TriangleStore& store, BinId bin,
                          const CancelToken& cancel) const;
  uint64_t copy_rows(uint64_t offset, const BatchSubvolume& subvolume, SolidRows& rows) const;

  std::unique_ptr<ReadableFile> file_;
  Batch batch_;
  uint64_t data_begin_ = 0;
};

}  // namespace voxdag
