// Builds one .vdag file from a scene.
//
//     voxdag::BuildOptions options;
//     options.scenes = {"scene.glb"};
//     options.resolution = 8192;
//     options.output = "scene.vdag";
//     const voxdag::BuildResult result = voxdag::build(options);
//
// A build can be interrupted at any time, even by SIGKILL: the same call resumes it from its work
// folder and produces the same bytes. Every byte of the file depends only on the scene and the
// geometry options, never on memory, threads or folders.
//
// build() and plan() throw voxdag::Error with one of the codes in voxdag/error.h and a message that
// names the problem, its place and the expected input. Both functions are thread-safe. Two builds
// with the same output or work folder cannot run at the same time. docs/library.md has the details.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "voxdag/cancel_token.h"
#include "voxdag/error.h"
#include "voxdag/mesh.h"

namespace voxdag {

// The device and the algorithm that voxelize a part of the scene. kAuto uses a GPU if one is
// present; kDefault is the backend's fastest method. docs/cli.md, "--method", lists the methods of
// each backend. All backends and methods produce the same bytes.
enum class BackendName { kAuto, kCpu, kCuda, kParallelHost };
enum class MethodName { kDefault, kConsing, kPointers, kHashes };

// Cutouts are parts of a surface that its material makes invisible (alpha modes MASK and BLEND).
// kSkip leaves out voxels in which all surfaces are cut out; kKeep ignores cutouts. kDefault means
// kSkip for a build with colors, and kKeep for a build without colors.
enum class CutoutRule { kDefault, kSkip, kKeep };

// The rule that decides which empty voxels are inside the surface and are filled (docs/solid.md).
// kNone fills nothing: only voxels that the surface touches are set.
enum class SolidName { kNone, kWinding, kParity, kEnclosed };

// The order of the nodes in the levels of the file (docs/format.md, "Node order"). A file in the
// order kFirstParent is faster to read. A file in the order kHash can be combined with other files.
enum class OrderName { kHash, kFirstParent };

struct BuildOptions {
  // The scene: files (glTF 2.0, PLY, OBJ, STL, LAS, text with points), a mesh in memory, or both.
  // The files and the mesh form one scene.
  std::vector<std::string> scenes;
  std::optional<Mesh> mesh;

  // Geometry options.
  uint64_t resolution = 0;  // voxels per edge of the grid, a power of two from 4 to 2^20
  // The cube of the grid, in the units of the scene. `bounds` gives its low corner (x, y, z) and
  // its edge. `voxel_size` gives the edge of a voxel; the cube is then centered on the scene. Set
  // at most one of the two. If neither is set, the cube encloses the scene.
  std::optional<std::array<double, 4>> bounds;
  std::optional<double> voxel_size;
  // Half the edge, in the units of the scene, of the cube that replaces each point of a point file.
  // If it is not set, a point sets exactly one voxel.
  std::optional<double> point_radius;
  // Names of the columns of text files with points, such as "x,y,z,_,r,g,b" (docs/scenes.md). If
  // `columns` is empty, the header line or the first row of a file determines its columns.
  std::string columns;
  // Names of extensions that a glTF file requires and voxdag does not read. The files are read
  // without them, with a warning.
  std::vector<std::string> ignore_extension;
  bool skip_invalid = false;  // drop and count invalid triangles instead of refusing the scene
  // Sets only voxels in which a triangle crosses a line along an axis through the voxel's center
  // (docs/solid.md).
  bool thin = false;
  CutoutRule cutouts = CutoutRule::kDefault;
  uint32_t hash_bits = 64;  // bits of the node hash, 4 to 64
  OrderName order = OrderName::kHash;
  SolidName solid = SolidName::kNone;
  // For kEnclosed: a point in the units of the scene. If it is set, only the enclosed space around
  // this point is filled.
  std::optional<std::array<double, 3>> seed;
  // Only for kEnclosed without a seed: the build seals gaps that are up to this many voxels wide.
  // At most 16.
  uint32_t radius = 0;
  // The attributes to store for each cell of the color grid. `color_resolution` is the number of
  // cells per edge of this grid, a power of two. 0 means the smaller of `resolution` and 4096.
  bool color = false, alpha = false, normal = false, material = false;
  uint64_t color_resolution = 0;

  // `output` is the file to write. `work_folder` is the folder for intermediate files; an empty
  // `work_folder` means output + ".work". The output path is created only by the final rename, so
  // it never holds a partial file.
  std::string output;
  std::string work_folder;
  bool keep_work = false;    // keep the work folder after success
  bool restart = false;      // discard the job in the work folder and start over
  bool force = false;        // build even if the estimated disk space exceeds the free space
  bool strict = false;       // throw Error{kInvalidInput} for a warning about the scene
  bool allow_empty = false;  // write a file without voxels instead of refusing the scene
  std::string cache_folder;  // folder for subvolumes shared between builds; "": no cache
  uint64_t cache_bytes = uint64_t{16} << 30;  // maximum size of the cache folder

  // Resources. If the allocator returns freed memory to the system (docs/library.md), the process
  // has at most memory_bytes + 64 MiB of resident memory, plus the memory of `mesh`.
  uint64_t memory_bytes = 0;    // at least 64 MiB; 0: half of the RAM or cgroup limit
  unsigned threads = 0;         // 0: all CPUs that the process may use
  uint64_t subvolume_edge = 0;  // in voxels, a power of two; 0: chosen by the plan
  BackendName backend = BackendName::kAuto;
  MethodName method = MethodName::kDefault;
};

// The state of a running build.
struct BuildProgress {
  std::string_view stage;  // "ingest", "build", "merge", ...
  std::string_view unit;   // the unit of done and total: "triangles", "subvolumes", ...
  uint64_t done = 0;
  uint64_t total = 0;  // 0 while unknown
};

// The functions may be empty, and `cancel` may be null. The build calls the functions from its
// threads; calls never overlap. The functions must not throw. To end the build, a function calls
// cancel->cancel().
struct BuildHooks {
  std::function<void(const BuildProgress&)> on_progress;  // called at most ten times a second
  std::function<void(std::string_view message)> on_warning;
  const CancelToken* cancel = nullptr;  // build() throws Error{kCanceled} soon after cancel()
};

// A fault of the scene that did not stop the build.
struct SceneWarning {
  std::string code;     // the kind, such as "ignored-extension" (docs/scenes.md)
  std::string place;    // the first place of the fault: the scene file and its element
  std::string message;  // one sentence about this place
  uint64_t count = 1;   // number of places
};

struct BuildResult {
  std::string output;
  std::string sha256;  // SHA-256 of the output, in hexadecimal digits
  uint64_t bytes = 0;  // size of the output
  uint32_t grid_levels = 0;
  std::array<double, 3> origin{};  // the low corner of the grid, in the units of the scene
  double edge = 0;                 // edge of the grid, in the units of the scene
  uint64_t triangles = 0;          // triangles that can touch the grid
  uint64_t dropped_outside = 0;    // triangles that miss the grid
  uint64_t dropped_invalid = 0;    // invalid triangles (see skip_invalid)
  uint64_t voxels = 0;
  uint64_t dag_nodes = 0;
  uint64_t subvolumes = 0;
  uint64_t subvolumes_reused = 0;  // subvolumes from an interrupted run or the cache
  double wall_s = 0, cpu_s = 0;
  uint64_t peak_memory_bytes = 0;  // peak resident memory of the complete process
  std::vector<SceneWarning> warnings;
  std::string json;  // the complete report, as `voxdag build --json` prints it
};

// Runs the build, or resumes the build in its work folder. Returns the result, and also writes the
// report to output + ".report.json".
BuildResult build(const BuildOptions& options, const BuildHooks& hooks = {});

// An estimated quantity, and the range in which it is expected.
struct EstimateRange {
  double low = 0, likely = 0, high = 0;
};

// The estimated resources of a build.
struct BuildPlan {
  uint64_t triangles = 0;
  EstimateRange voxels, dag_nodes;
  EstimateRange file_bytes;    // size of the output
  EstimateRange disk_bytes;    // output and work folder at their peak
  EstimateRange memory_bytes;  // peak resident memory
  EstimateRange cpu_s, wall_s;
  uint64_t free_disk = 0;    // free bytes on the disk of the work folder; 0 if unknown
  uint64_t free_memory = 0;  // the build's memory limit
  std::string json;          // the complete estimate, as `voxdag plan --json` prints it
};

// Returns an estimate of a build. Creates no files.
BuildPlan plan(const BuildOptions& options, const BuildHooks& hooks = {});

}  // namespace voxdag
