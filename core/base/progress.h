// The interface through which a build or another command reports its progress. Stages run one after
// another. Within a stage any thread may call advance(). Implementations (a progress bar, plain
// lines, the service) are thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>

#include "core/base/warning.h"

namespace voxdag {

// A subvolume of a build, as shown to users.
struct SubvolumeStatus {
  int64_t id = 0;
  std::array<uint64_t, 3> corner{};  // low corner, in voxels of the grid
  uint64_t edge = 0;                 // in voxels
  bool built = false;
  // Contents of a built subvolume.
  uint64_t voxels = 0;
  uint64_t nodes = 0;  // unique nodes
  uint64_t bytes = 0;  // size of its artifact
};

// The batches of a build on a cluster, and the tasks that build them. A *node* is a machine of the
// cluster in this struct.
struct ClusterTasks {
  uint64_t batches = 0;                           // total
  uint64_t built = 0;                             // built batches
  uint64_t waiting = 0;                           // tasks that wait for a node
  uint64_t failed_attempts = 0;                   // failed attempts of tasks
  std::map<std::string, uint64_t> running;        // number of running tasks, by node
  std::map<std::string, uint64_t> built_of_node;  // number of built batches, by node
};

class Progress {
 public:
  virtual ~Progress() = default;
  // Reports that a stage starts. The stage has `total` units of work, or 0 if the number is
  // unknown. `unit` is the plural name of a unit ("triangles", "subvolumes", "nodes").
  virtual void begin_stage(std::string_view stage, uint64_t total, std::string_view unit) = 0;
  // Reports that an earlier run has done `done` units of the stage. They count toward the total,
  // but not toward the displayed rate. A stage that resumes calls this after begin_stage().
  virtual void resume_at(uint64_t done) = 0;
  // Reports that `count` more units are done.
  virtual void advance(uint64_t count) = 0;
  // Reports a total that became known or has changed, for example because a subvolume was split.
  virtual void set_total(uint64_t total) = 0;
  virtual void end_stage() = 0;
  // Reports a warning that a user should read. `message` is one sentence.
  virtual void warn(std::string_view message) = 0;
  // Reports a warning about the input. Throws Error{kInvalidInput} if the command treats these
  // warnings as errors.
  virtual void warn_of_input(const Warning& warning) { warn(warning.text()); }

  // Reports the grid's low corner and edge length, in the units of the scene. Called before
  // set_subvolumes().
  virtual void set_grid(const std::array<double, 3>& /*origin*/, double /*edge*/) {}
  // Reports all subvolumes of the build, including subvolumes built by an earlier run. `resolution`
  // is the number of voxels along an edge of the grid. Replaces all earlier reports of subvolumes.
  virtual void set_subvolumes(uint64_t /*resolution*/, std::span<const SubvolumeStatus> /*all*/) {}
  // Reports that a worker has begun to build a planned subvolume. The subvolume is finished when
  // subvolume_built() or subvolume_split() is called.
  virtual void subvolume_begun(int64_t /*id*/) {}
  virtual void subvolume_built(const SubvolumeStatus& /*built*/) {}
  // Reports that `parts` replace the subvolume `id`.
  virtual void subvolume_split(int64_t /*id*/, std::span<const SubvolumeStatus> /*parts*/) {}
  // Reports the current resource usage: resident memory, and disk space of the work folder.
  virtual void set_usage(uint64_t /*memory_bytes*/, uint64_t /*disk_bytes*/) {}
  // Reports the current state of the tasks of a cluster build.
  virtual void set_cluster_tasks(const ClusterTasks& /*tasks*/) {}
};

// Ignores all reports.
class NoProgress : public Progress {
 public:
  void begin_stage(std::string_view, uint64_t, std::string_view) override {}
  void resume_at(uint64_t) override {}
  void advance(uint64_t) override {}
  void set_total(uint64_t) override {}
  void end_stage() override {}
  void warn(std::string_view) override {}
};

}  // namespace voxdag
