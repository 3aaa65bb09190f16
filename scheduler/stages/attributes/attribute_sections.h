// The attributes stage of a build. It writes the attribute sections, which follow the levels in the
// global file.
#pragma once

#include <string>

#include "core/format/global/global_writer.h"
#include "scheduler/stages/attributes/color_stage.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

class AttributeSections {
 public:
  explicit AttributeSections(BuildJob& job) : job_(job) {}

  // Adds the sections to a file that already has all its levels. Does nothing for a build without
  // attributes.
  void add_to(GlobalFileWriter& out);
  // Returns a digest of all inputs of the sections; "" for a build without attributes. After
  // add_to(), this is the digest of the inputs that add_to() used. Before add_to(), reads the
  // inputs, and fills in the color report from the output file of an earlier run.
  std::string digest();

 private:
  bool is_enabled() const { return job_.spec.geometry.attributes.any(); }
  ColorStage open_stage();

  BuildJob& job_;
  std::string added_digest_;
};

}  // namespace voxdag
