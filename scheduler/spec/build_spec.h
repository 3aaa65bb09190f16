// The options of a build, and the interfaces through which the build reaches its environment.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/color/attribute_set.h"
#include "core/geometry/cube.h"
#include "core/geometry/grid.h"
#include "core/geometry/solid_rule.h"
#include "core/geometry/voxel_rule.h"
#include "core/io/file_system.h"
#include "voxdag/build.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

class CommandRunner;

// The names of these enumerations are the values that users write.
constexpr std::array<const char*, 4> enum_names(BackendName) {
  return {"auto", "cpu", "cuda", "parallel-host"};
}
constexpr std::array<const char*, 4> enum_names(MethodName) {
  return {"", "consing", "pointers", "hashes"};
}
constexpr std::array<const char*, 3> enum_names(CutoutRule) { return {"", "skip", "keep"}; }
constexpr std::array<const char*, 4> enum_names(SolidName) {
  return {"", "winding", "parity", "enclosed"};
}
constexpr std::array<const char*, 2> enum_names(OrderName) { return {"hash", "first-parent"}; }
enum class ClusterEngine { kNone, kSlurm };
constexpr std::array<const char*, 2> enum_names(ClusterEngine) { return {"", "slurm"}; }

// Options that determine the bytes of the global file.
struct GeometryOptions {
  std::vector<std::string> scenes;              // files that together form one scene
  uint64_t resolution = 0;                      // R, a power of two from 4 to 2^20
  std::optional<std::array<double, 4>> bounds;  // X, Y, Z of the low corner, EDGE
  std::optional<double> voxel_size;
  bool skip_invalid = false;
  bool thin = false;  // the rule VoxelRule::kThin
  CutoutRule cutouts = CutoutRule::kDefault;
  std::optional<double> point_radius;         // half edge of the cube that replaces each point
  std::string columns;                        // names of the columns of text files with points
  std::vector<std::string> ignore_extension;  // required glTF extensions to ignore
  uint32_t hash_bits = 64;
  OrderName order = OrderName::kHash;  // the order of the nodes in each level
  SolidName solid = SolidName::kNone;  // the rule that fills the interior
  // A point in scene units. If it is set, only the enclosed space around the point is filled.
  std::optional<std::array<double, 3>> seed;
  uint32_t radius = 0;      // enclosed solids: seals gaps of up to this many voxels
  AttributeSet attributes;  // attributes of the color grid's cells
  // Cells per edge of the color grid, a power of two from 4 to the resolution; 0: the build chooses
  // it.
  uint64_t color_resolution = 0;

  VoxelRule rule() const { return thin ? VoxelRule::kThin : VoxelRule::kShell; }
};

// Returns the rule for the stages `rows` and `build`. They build only the shell of an enclosed
// solid; the stage `enclose` fills it.
inline SolidRule solid_rule_of(const GeometryOptions& options) {
  return options.solid == SolidName::kEnclosed ? SolidRule::kNone
                                               : static_cast<SolidRule>(options.solid);
}

// Maximum resolution of a build with a radius. Such a build also needs a grid of twice its
// resolution (stages/enclose/cube_walks.h), which can have at most kMaxGridLevels levels.
inline constexpr uint64_t kMaxRadiusResolution = uint64_t{1} << (kMaxGridLevels - 1);

// Returns the maximum number of levels of the grid of a build with these options.
inline uint32_t max_levels_of(const GeometryOptions& options) {
  return static_cast<uint32_t>(options.radius > 0 ? kMaxGridLevels - 1 : kMaxGridLevels);
}

// Returns the geometry options as one line of JSON, for comparing jobs and for messages. Scenes are
// left out because only their content matters.
std::string geometry_json(const GeometryOptions& options);

// Options of a build whose subvolumes are built by a cluster's tasks instead of this process's
// threads.
struct ClusterOptions {
  ClusterEngine engine = ClusterEngine::kNone;
  uint64_t tasks = 0;          // 0: the build chooses a number from the expected work
  uint64_t max_running = 0;    // max concurrent tasks; 0 for no limit
  std::string submit_options;  // more sbatch options, split as by a shell
  std::string program_path;    // path of voxdag, the same on all machines; "": this program
  std::string program_version;
  uint64_t max_retries = 3;  // max retries of one failed batch
  // Seconds until the record of an ended task must be visible on the shared disk.
  double grace_s = 15;
  double slurm_interval_s = 5;  // seconds between two queries to Slurm
  // Seconds for which a submission is repeated if Slurm refuses it because of missing nodes. Slurm
  // knows no nodes just after it was started.
  double slurm_start_s = 15;
  // Options of the merge job (MergeJob). Without them this process merges.
  struct MergeJobOptions {
    // This program's arguments. The merge job gets the same arguments, so it runs the same build.
    std::vector<std::string> arguments;
    std::string folder;  // the merge job's working directory
    std::vector<std::string> submit_options;
  };
  std::optional<MergeJobOptions> merge_job;
  bool is_merge_job = false;  // this process is the merge job
  // Runs Slurm's commands. Null: the build uses the system's commands. Tests set a fake runner.
  CommandRunner* commands = nullptr;
};

// Options that never change the bytes of the global file.
struct RunOptions {
  std::string output;           // the global file
  std::string report;           // the report; "": output + ".report.json"; "none": no report
  std::string work_folder;      // "": output + ".work"
  uint64_t memory_bytes = 0;    // 0: half of the memory that RAM and cgroup allow
  unsigned threads = 0;         // 0: all CPUs that the process may use
  uint64_t subvolume_edge = 0;  // in voxels, a power of two; 0: chosen by the plan
  BackendName backend = BackendName::kAuto;
  MethodName method = MethodName::kDefault;
  std::string cache_folder;  // "": no cache
  uint64_t cache_bytes = uint64_t{16} << 30;
  // Disk space that the build leaves free. If less would remain, the build ends with
  // Error{kNoSpace} and can be resumed.
  uint64_t min_free_bytes = 0;
  // Seconds between checkpoints: CPU time during the merge, wall time in the stages before it.
  double checkpoint_interval_s = 2;
  // Ingest makes checkpoints only for scenes with at least this many triangles. Smaller scenes are
  // read again instead, which takes at most about two CPU seconds.
  uint64_t durable_min_triangles = uint64_t{4} << 20;
  // Maximum seconds to wait for locks that another build holds. The other build can be about to
  // end, so the wait is worthwhile.
  double lock_wait_s = 30;
  bool keep_work = false;
  bool restart = false;      // discard the job in the work folder and start over
  bool force = false;        // build even if the estimate does not fit
  bool strict = false;       // treat warnings about the scene as errors
  bool allow_empty = false;  // write a file without voxels instead of refusing the scene
  std::optional<ClusterOptions> cluster;
};

struct BuildSpec {
  GeometryOptions geometry;
  RunOptions run;
};

// Thrown for a build whose estimate does not fit; RunOptions::force builds it anyway.
struct DoesNotFit : Error {
  explicit DoesNotFit(std::string message) : Error(ErrorCode::kNoSpace, std::move(message)) {}
};

// The interfaces to a build's environment: the file system, the progress display and cancellation.
struct BuildContext {
  FileSystem& files;
  Progress& progress;
  const CancelToken& cancel;
};

// The context, threads and memory of a stage.
struct StageContext {
  const BuildContext& build;
  unsigned threads = 1;
  MemoryBudget& budget;
};

}  // namespace voxdag
