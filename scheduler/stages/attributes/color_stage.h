// Bakes the colors of a scene and other attributes of its cells (docs/color.md). Reads the surfaces
// again and bins them by cubes of the color grid. All threads bake cubes, which are written in
// Morton order behind the levels of the global file, one section for each attribute.
//  Resume rule: a baked cube is stored in the work folder (color_store.h) under a key of all its
// inputs (color_keys.h), and a later run with an equal key reuses it. A stopped run loses only
// unfinished cubes; a changed texture loses only the cubes that show it. Images that no missing
// cube shows are not decoded.
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
  // Returns digest(). If `output`, a valid file of an earlier run, has the colors of that digest,
  // also fills in `report`.
  std::string digest_of(FileSystem& files, const std::string& output,
                        std::optional<ColorReport>& report);
  // Adds the sections to `out`, which has all its levels and is not sealed. Does nothing for a file
  // without levels. Call it once.
  ColorReport add_to(GlobalFileWriter& out);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace voxdag
