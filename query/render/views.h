// Default camera placements, and the bounds of the occupied part of the grid. Functions that take a
// DAG require that it is not empty.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "query/dag/dag_view.h"
#include "query/render/camera.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// Converts a point in voxels to world space.
std::array<double, 3> world_point(const Vec& point, const voxdag_reader::File& file);

struct Box {
  Vec low, high;  // in voxels
  Vec center() const { return mix(low, high, 0.5); }
  double diagonal() const { return length(high - low); }
};

// Returns the bounding box of the occupied cells whose edge is 1/2048 of the grid's edge, or of the
// voxels if these are larger. If this would require visiting more than 2^25 cells, returns a larger
// box. Throws the error of `cancel`.
Box occupied_box(const DagView& dag, const CancelToken& cancel = {});

// Occupied cells of one size.
struct OccupiedCells {
  std::vector<Vec> centers;
  double edge;
  // Returns points that must be in the picture so that it shows all cells: the centers of the
  // cells, or the corners of the cells if there are only few cells.
  std::vector<Vec> outline() const;
};
// Returns the occupied cells whose edge is 1/64 of the grid's edge. If there are fewer than 256
// such cells, the scene is small in its grid, and finer cells are returned.
OccupiedCells occupied_cells(const DagView& dag);

// Returns "auto", "iso", "front", "back", "left", "right", "top" and "inside".
const std::vector<std::string>& view_names();

// Returns the placement of the view `name`. "inside" is a position within the scene with a long
// view and much detail. "auto" is "inside" if most of the scene cannot be seen from outside,
// otherwise "iso". `aspect` is the picture's width divided by its height. Without `fov_degrees`,
// the field of view is 62 degrees for "inside" and 32 degrees for the other views.
//
// "inside" and "auto" cast rays for up to half a second. If the scene is dust (small separate
// particles, between which rays pass through thousands of cells), these two views take one to two
// seconds. The rays read a limited number of nodes. At this limit, the result is the best view so
// far, or "iso".
//
// Throws Error{kInvalidInput} for an unknown name, and the error of `cancel`.
Placement named_view(const std::string& name, const DagView& dag, double aspect,
                     std::optional<double> fov_degrees, const CancelToken& cancel = {});

// Like named_view(), but for several views of the same DAG: data that several views need is
// computed only for the first of them. The DAG and the token must outlive this object.
class NamedViews {
 public:
  NamedViews(const DagView& dag, const CancelToken& cancel) : dag_(dag), cancel_(cancel) {}
  // Returns occupied_box() of the DAG.
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
