// What the service tells a job's process, and what that tells back, line by line on its standard
// output.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/file_system.h"
#include "scheduler/build_spec.h"

namespace voxdag::server {

// Written to task.json. `text` is a JobRequest's; what it leaves open is decided here.
struct Task {
  enum class Kind { kBuild, kPlan };
  Kind kind = Kind::kBuild;
  std::string text;
  std::vector<std::string> scene_paths;  // of the request's scenes, in their order
  std::vector<std::string> readable;  // files, and folders ending in '/', that scenes may refer to
  uint64_t memory_bytes = 0;
  unsigned threads = 0;
};
void write_task(FileSystem& files, const std::string& path, const Task& task);
Task read_task(FileSystem& files, const std::string& path);

// One line of a job's process.
struct Report {
  enum class Kind {
    kStage,    // text: its name, unit, total
    kAdvance,  // done, total
    kEnd,      // of the stage
    kBuilt,    // what is built of the subvolumes
    kWarning,  // text
    kError,    // code, text
    kResult,   // text: JSON
  };
  Kind kind = Kind::kStage;
  std::string text, unit, code;
  uint64_t done = 0, total = 0;
  // Of kBuilt; done and total count subvolumes.
  uint64_t voxels = 0, nodes = 0, bytes = 0, memory_bytes = 0, disk_bytes = 0;
};
// One line of JSON, without its end.
std::string report_line(const Report& report);
// No value for a line that is none of ours.
std::optional<Report> parse_report(std::string_view line);

}  // namespace voxdag::server
