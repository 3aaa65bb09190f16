// The attributes stage of one build: the sections that follow the levels of its global file.
#pragma once

#include <string>

#include "core/format/global/global_writer.h"
#include "scheduler/stages/attributes/color_stage.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

class AttributeSections {
 public:
  explicit AttributeSections(BuildJob& job) : job_(job) {}

  // Adds the sections to a file that has all its levels. Does nothing for a build without
  // attributes.
  void add_to(GlobalFileWriter& out);
  // A digest of all that the sections depend on: as they were added, or else as they are in the
  // output of an earlier run. "" for a build without attributes.
  std::string digest();

 private:
  bool is_enabled() const { return job_.spec.geometry.attributes.any(); }
  ColorStage open_stage();

  BuildJob& job_;
  std::string added_digest_;
};

}  // namespace voxdag
