// Default camera placements, and the bounds of the occupied part of the grid. All functions of a
// DAG require a DAG that is not empty.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "query/dag/dag_view.h"
#include "query/render/camera.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// Where a point in voxels is in the world.
std::array<double, 3> world_point(const Vec& point, const voxdag_reader::File& file);

struct Box {
  Vec low, high;  // in voxels
  Vec center() const { return mix(low, high, 0.5); }
  double diagonal() const { return length(high - low); }
};

// The box around the occupied cells of 1/2048 of the grid's edge; a larger one if that would take
// more than some tens of millions of cells. Throws as `cancel` does.
Box occupied_box(const DagView& dag, const CancelToken& cancel = {});

// Occupied cells of one size.
struct OccupiedCells {
  std::vector<Vec> centers;
  double edge;
  // Points that a view must have in its picture to show the cells: their centers, or their corners
  // if there are few cells.
  std::vector<Vec> outline() const;
};
// Those of 1/64 of the grid's edge; finer ones where there are few of them, since the scene is
// small in its grid.
OccupiedCells occupied_cells(const DagView& dag);

// "auto", "iso", "front", "back", "left", "right", "top", "inside".
const std::vector<std::string>& view_names();

// The placement of a named view. "inside" is a place within the scene with a long view, walls
// around and a floor below; "auto" is "inside" for a scene most of which cannot be seen from
// outside, and "iso" for any other. `aspect` is the picture's width divided by its height; without
// `fov_degrees`, the view decides on the field of view. Throws Error{kInvalidInput} for another
// name, and as `cancel` does: "inside" and "auto" cast rays for up to half a second. For a
// second or two if the scene is dust: their number of steps is limited, and the view is the best of
// those tried until then, or "iso".
Placement named_view(const std::string& name, const DagView& dag, double aspect,
                     std::optional<double> fov_degrees, const CancelToken& cancel = {});

// The same for several views of a DAG, with their common parts computed once. Refers to the DAG and
// the token.
class NamedViews {
 public:
  NamedViews(const DagView& dag, const CancelToken& cancel) : dag_(dag), cancel_(cancel) {}
  // occupied_box()
  const Box& box();
  Placement find(const std::string& name, double aspect, std::optional<double> fov_degrees);

 private:
  const OccupiedCells& cells();

  const DagView& dag_;
  const CancelToken& cancel_;
  std::optional<Box> box_;
  std::optional<OccupiedCells> cells_;
};

}  // namespace voxdag::query
