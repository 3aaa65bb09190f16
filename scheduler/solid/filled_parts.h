// The durable state of the stage `enclose`: the artifacts of the parts of the grid that it has
// filled. In the merge, they replace the artifacts of the subvolumes, which have only the shell
// (the voxels that triangles touch). A filled part depends only on the scene and on the geometry
// options, so a part that an earlier run has filled remains valid, even if this run divides the
// grid differently.
//
// add_durable() and save() replace the record on the disk atomically (by renaming). Thread-safe,
// except load(), complete() and forget().
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/format/artifact/segment_writer.h"
#include "core/geometry/cube.h"
#include "core/io/file_system.h"

namespace voxdag {

struct FilledPart {
  Cube cube;
  ArtifactRef artifact;
  uint64_t voxels = 0;
};

class FilledParts {
 public:
  // `identity` identifies the job: load() ignores parts that were saved with another identity.
  FilledParts(FileSystem& files, std::string path, std::string identity);

  // Loads the parts that an earlier run saved, if any.
  void load();
  // Removes all parts, also from the disk.
  void forget();

  // Returns the part with this cube, if it is filled.
  std::optional<FilledPart> find(const Cube& cube) const;
  // Adds parts whose segments are synced, and saves the record.
  void add_durable(const std::vector<FilledPart>& parts);

  // Replaces the parts by the complete result: parts that together have all voxels of the solid.
  // `segments` are the segments that this run wrote, after SegmentWriter::complete(). They need not
  // be synced yet; save() syncs them.
  void complete(std::vector<FilledPart> parts,
                std::vector<std::unique_ptr<SegmentWriter>> segments);
  bool is_complete() const { return is_complete_; }
  // Returns all parts.
  std::vector<FilledPart> parts() const;
  // Returns the artifacts of a complete record.
  std::vector<ArtifactRef> artifacts() const;
  // Makes a complete record durable. Does nothing if the record is durable or not complete.
  void save();

  bool names_segment(uint32_t segment) const;

 private:
  std::vector<std::byte> encode() const;
  bool decode(std::span<const std::byte> bytes);
  void write() const;

  FileSystem& files_;
  const std::string path_;
  const std::string identity_;
  mutable std::mutex mutex_;  // guards the members below
  std::map<Cube, FilledPart> parts_;
  bool is_complete_ = false;
  bool is_saved_ = false;  // the complete record is durable
  std::vector<std::unique_ptr<SegmentWriter>> segments_;
};

}  // namespace voxdag
