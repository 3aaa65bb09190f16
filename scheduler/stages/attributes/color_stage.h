// Bakes the colors of a scene and other attributes of its cells (docs/color.md). Reads the surfaces
// (triangles with their materials) again and bins them by cubes of the color grid. All threads bake
// cubes. The results are written in Morton order after the levels of the global file, one section
// for each attribute.
//
// Resume rule: a baked cube is stored in the work folder (color_store.h) under a key of all its
// inputs (color_keys.h), and a later run with an equal key reuses it. A stopped run loses only
// unfinished cubes. After a change of an image, only the cubes that show the image are baked again.
// An image is decoded only if one of the cubes to bake can show it.
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
  const GeometryOptions& options;  // must have attributes and a color resolution
  Grid grid;
  std::string digest;            // digest of the triangles that ingest read
  std::string work_folder;       // for scratch files
  std::string artifact_path;     // file of the stored artifacts (color_store.h)
  double checkpoint_interval_s;  // seconds between two syncs of that file
};

class ColorStage {
 public:
  // Opens the scene. The objects referenced by `source` and `context` must outlive the stage.
  // Throws Error, as do all functions below.
  ColorStage(const ColorSource& source, const StageContext& context);
  ~ColorStage();

  // Returns the SHA-256 of the keys of all cubes, and of the materials' names if an attribute needs
  // them. Equal digests mean equal sections. Reads the scene and its images.
  std::string digest();
  // Returns digest(), and fills in `report` from `output`, a valid file of an earlier run. The
  // report is correct only if that file has the sections of this digest.
  std::string digest_of(FileSystem& files, const std::string& output,
                        std::optional<ColorReport>& report);
  // Adds the sections to `out`, which has all its levels and is not sealed
  // (GlobalFileWriter::seal()). Does nothing for a file without levels. May be called only once.
  ColorReport add_to(GlobalFileWriter& out);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace voxdag
