#include "scheduler/stages/attributes/attribute_sections.h"

namespace voxdag {

ColorStage AttributeSections::open_stage() {
  return {{job_.scene, job_.spec.geometry, job_.report.grid, job_.store->job()->scene_digest,
           job_.work.path(), job_.work.colors_path(), job_.spec.run.checkpoint_interval_s},
          job_.stage()};
}

void AttributeSections::add_to(GlobalFileWriter& out) {
  if (!is_enabled()) return;
  ColorStage stage = open_stage();
  job_.report.colors = stage.add_to(out);
  added_digest_ = stage.digest();
  job_.report.spill_bytes += job_.report.colors->spill_bytes;
  job_.clock.finish("color");
}

std::string AttributeSections::digest() {
  if (!is_enabled() || !added_digest_.empty()) return added_digest_;
  return open_stage().digest_of(job_.context.files, job_.spec.run.output, job_.report.colors);
}

}  // namespace voxdag
