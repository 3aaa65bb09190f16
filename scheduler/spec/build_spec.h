// The options of a build, and the interfaces through which it reaches its environment.
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
#include "core/geometry/grid.h"
#include "core/io/file_system.h"
#include "voxdag/build.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

class CommandRunner;

// The names of these enumerations are the values that people write.
constexpr std::array<const char*, 4> enum_names(BackendName) {
  return {"auto", "cpu", "cuda", "parallel-host"};
}
constexpr std::array<const char*, 4> enum_names(MethodName) {
  return {"", "consing", "pointers", "hashes"};
}
enum class ClusterEngine { kNone, kSlurm };
constexpr std::array<const char*, 2> enum_names(ClusterEngine) { return {"", "slurm"}; }

// Geometry options decide the bytes of the global file.
struct GeometryOptions {
  std::vector<std::string> scenes;              // glTF files, together one scene
  uint64_t resolution = 0;                      // R, a power of two from 4 to 2^20
  std::optional<std::array<double, 4>> bounds;  // X, Y, Z of the low corner, EDGE
  std::optional<double> voxel_size;
  bool skip_invalid = false;
  uint32_t hash_bits = 64;
  AttributeSet attributes;  // of the cells of the color grid
  // K of the color grid, a power of two from 4 to the resolution; 0 for a choice by the build.
  uint64_t color_resolution = 0;
};

// Geometry options as one line of JSON, to compare jobs and for messages. Scenes are left out: only
// their content counts.
std::string geometry_json(const GeometryOptions& options);

// Subvolumes are built by the tasks of a cluster's engine instead of this process's threads.
struct ClusterOptions {
  ClusterEngine engine = ClusterEngine::kNone;
  uint64_t tasks = 0;          // 0 for a choice by expected work
  uint64_t max_running = 0;    // max concurrent tasks; 0 for no limit
  std::string submit_options;  // further options of sbatch, as a shell would split them
  std::string program_path;    // of voxdag, the same on all machines; "" for this program's
  std::string program_version;
  uint64_t max_retries = 3;  // of a batch that fails
  // Time within which the record of an ended task becomes visible on the shared disk.
  double grace_s = 15;
  double slurm_interval_s = 5;  // between two questions to Slurm
  // Time for which Slurm may not know the requested nodes after its start.
  double slurm_start_s = 15;
  // Options of the merge job (slurm/merge_job.h). Without them this process merges.
  struct MergeJobOptions {
    std::vector<std::string> arguments;  // this program's, for the same build as that job
    std::string folder;                  // in which it runs
    std::vector<std::string> submit_options;
  };
  std::optional<MergeJobOptions> merge_job;
  bool is_merge_job = false;  // this process is that job
  // Runs Slurm's commands; tests have others. Null for the system's.
  CommandRunner* commands = nullptr;
};

// Run options never change the bytes of the global file.
struct RunOptions {
  std::string output;           // the global file
  std::string work_folder;      // "" for output + ".work"
  uint64_t memory_bytes = 0;    // 0 for half of what RAM and cgroup allow
  unsigned threads = 0;         // 0 for all that the process may use
  uint64_t subvolume_edge = 0;  // voxels, a power of two; 0 for a choice by the plan
  BackendName backend = BackendName::kAuto;
  MethodName method = MethodName::kDefault;
  std::string cache_folder;  // "" for none
  uint64_t cache_bytes = uint64_t{16} << 30;
  // Interval between checkpoints: CPU time in the merge, wall time before it.
  double checkpoint_interval_s = 2;
  // Triangles of a scene whose ingest, then about two CPU seconds, is worth checkpoints.
  uint64_t durable_min_triangles = uint64_t{4} << 20;
  // Maximum wait for the locks of another build, which may be ending.
  double lock_wait_s = 30;
  bool keep_work = false;
  bool restart = false;  // start over, whatever the work folder holds
  bool force = false;    // build even if the estimate does not fit
  std::optional<ClusterOptions> cluster;
};

struct BuildSpec {
  GeometryOptions geometry;
  RunOptions run;
};

// Refuses a build whose estimate does not fit; RunOptions::force builds it anyway.
struct DoesNotFit : Error {
  explicit DoesNotFit(std::string message) : Error(ErrorCode::kNoSpace, std::move(message)) {}
};

// The outside world of a build.
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
