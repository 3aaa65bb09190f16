// The durable state of a solid between the stages `rows`, `build` and `merge`. It consists of the
// views (core/geometry/solid_rule.h) from the low faces of each subvolume, and of the full cubes
// (FullCube). The *shell* consists of the voxels that triangles touch.
//
//   header    magic, offset of the last index, checksum
//   rows      compressed views of one subvolume along one axis
//   index     the job, the subvolumes with the extents of their rows, the full cubes, the counts
//
// The triangles of built subvolumes are freed, so the views cannot be computed again once a
// subvolume is built. save() makes everything durable: it appends an index, and then replaces the
// header, which has the offset of the last index. Thread-safe, except load() and start().
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/geometry/cube.h"
#include "core/geometry/solid_rule.h"
#include "core/io/file_system.h"
#include "scheduler/solid/row_file.h"

namespace voxdag {

constexpr std::array<const char*, 3> enum_names(SolidRule) { return {"", "winding", "parity"}; }

// State of a subvolume in a solid. A unit is a maximal cube without voxels of the shell; it is
// filled or left empty as one piece (core/geometry/solid_rule.h).
enum class SolidUnit : uint32_t {
  kShell,      // the subvolume has voxels of the shell
  kEmptyUnit,  // a part of a split subvolume without voxels of the shell; the part is a unit
  kEmpty,      // a planned subvolume without voxels of the shell; SolidRows::full_cubes has the
               // unit that contains it, if this unit is inside the solid
};

constexpr std::array<const char*, 3> enum_names(SolidUnit) { return {"", "empty-unit", "empty"}; }

struct SubvolumeRows {
  SolidUnit unit = SolidUnit::kShell;
  RowExtent views[3];
};

// A unit (see SolidUnit) that is inside the solid and outside all subvolumes with voxels of the
// shell.
struct FullCube {
  Cube cube;
  bool is_disputed = false;
};

// Numbers of sample rows of the grid.
struct RowCounts {
  uint64_t rows = 0;  // rows with a crossing
  uint64_t open = 0;  // rows with crossings whose signs do not sum to 0
  uint64_t odd = 0;   // rows with an odd number of crossings
};

class SolidRows {
 public:
  // `identity` identifies the job: load() ignores rows that were saved with another identity.
  SolidRows(FileSystem& files, std::string path, SolidRule rule, uint32_t grid_levels,
            std::string identity);
  ~SolidRows();

  // Loads the state that save() stored last. Returns false if this job has none.
  bool load();
  // True after load() returned true, and after start().
  bool is_ready() const { return file_ != nullptr; }
  // Starts an empty file.
  void start();
  // Makes all added rows, `full_cubes` and `counts` durable.
  void save();

  SolidRule rule() const { return rule_; }
  uint32_t grid_levels() const { return grid_levels_; }
  RowFile& file() { return *file_; }
  void add(const Cube& cube, const SubvolumeRows& rows);
  SubvolumeRows find(const Cube& cube) const;
  // Reads the views from a subvolume's low faces. The caller charges row_bytes() for them to its
  // budget.
  SolidEntry read_entry(const Cube& cube) const;

  std::vector<FullCube> full_cubes;
  RowCounts counts;

 private:
  std::vector<std::byte> encode_index() const;
  bool decode_index(std::span<const std::byte> bytes);

  FileSystem& files_;
  const std::string path_;
  const SolidRule rule_;
  const uint32_t grid_levels_;
  const std::string identity_;
  mutable std::mutex mutex_;  // guards the members below
  std::map<Cube, SubvolumeRows> cubes_;
  std::unique_ptr<RowFile> file_;
};

}  // namespace voxdag
