// The messages from a job's process to the service. Each line of the process's standard output is
// one message, a JSON object. Its member "message" is the name of the message. Its other members
// are the members of the message's struct.
//
//   {"message":"stage_advanced","done":12,"total":64}
//
// The service does not trust a job's process. It ignores a line that is broken, incomplete or not a
// known message.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "core/base/progress.h"

namespace voxdag::server {

// "stage_begun": the first message of a stage. `total` is the number of `unit`s in the stage; 0 if
// unknown.
struct StageBegun {
  std::string stage, unit;
  uint64_t total = 0;
};
// "stage_resumed": earlier attempts completed `done` units of the stage.
struct StageResumed {
  uint64_t done = 0;
};
// "stage_advanced": `done` of the stage's `total` units are completed.
struct StageAdvanced {
  uint64_t done = 0, total = 0;
};
// "stage_ended": the last message of a stage.
struct StageEnded {};
// "subvolumes": the number of all subvolumes, the number of built subvolumes, and totals over the
// built subvolumes.
struct SubvolumeTotals {
  uint64_t built = 0, total = 0;
  uint64_t voxels = 0, nodes = 0, bytes = 0;
};
// "usage": resident memory, and disk space of the work folder.
struct Usage {
  uint64_t memory_bytes = 0, disk_bytes = 0;
};
// "cluster_tasks": the tasks of a build on a cluster, with the members of ClusterTasks.
using voxdag::ClusterTasks;
// "warning": a warning about the scene. A warning about the machine has the code "build" and no
// place.
struct WarningReported {
  Warning warning;
};
// "failure": the last message of a failed job. `code` is a code of docs/errors.md, or "internal".
struct Failure {
  std::string code, text;
};
// "result": the last message of a successful job. `json` is one object.
struct Result {
  std::string json;
};

using Message = std::variant<StageBegun, StageResumed, StageAdvanced, StageEnded, SubvolumeTotals,
                             Usage, ClusterTasks, WarningReported, Failure, Result>;

// Returns one line of JSON, without the newline.
std::string encode(const Message& message);
// Returns the message of a line; nullopt if the line is not a known message.
std::optional<Message> decode(std::string_view line);

}  // namespace voxdag::server
