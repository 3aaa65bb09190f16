// The colors of a scene, and other attributes of its cells (docs/color.md): its surfaces are read
// once more and binned by cubes of the color grid; the cubes are baked on all threads, and written
// in Morton order behind the levels of the global file, a section for each attribute.
//
// A cube is a task: what it became is stored in the work folder (color_store.h) under a key of all
// that it depends on (color_keys.h), and used again by a later run for which the key is the same.
// So a run that is stopped loses the cubes that it was baking, and a changed texture those that
// show it. Images that no missing cube shows are not decoded.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "core/format/global/global_writer.h"
#include "core/geometry/grid.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/spec/stage_totals.h"
#include "scheduler/state/build_scene.h"

namespace voxdag {

struct ColorSource {
  BuildScene& scene;
  const GeometryOptions& options;  // with attributes and a color resolution
  Grid grid;
  std::string digest;            // of the scene's triangles, as ingest read them
  std::string work_folder;       // for scratch files
  std::string artifact_path;     // of the colors that outlive a run
  double checkpoint_interval_s;  // between two times that those are made durable
};

class ColorStage {
 public:
  // Opens the scene. What both refer to must outlive the stage. Throws Error, as all below.
  ColorStage(const ColorSource& source, const StageContext& context);
  ~ColorStage();

  // SHA-256 of the keys of all cubes: equal where the colors are equal. Reads the scene and its
  // images.
  std::string digest();
  // The same, and what is to be reported if `output`, a sound file that an earlier run has
  // finished, has the colors of that digest.
  std::string digest_of(FileSystem& files, const std::string& output,
                        std::optional<ColorReport>& report);
  // `out` has all its levels, and is not sealed; it stays as it is if there are none. Once.
  ColorReport add_to(GlobalFileWriter& out);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace voxdag
