#include "server/tiles/partial/partial_frame.h"

#include <bit>
#include <vector>

#include "core/base/error.h"
#include "core/dag/brick.h"
#include "core/fields/json_text.h"
#include "core/geometry/grid.h"
#include "query/render/views.h"
#include "server/tiles/partial/partial_dag.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kMaxPlanBytes = uint64_t{1} << 30;

// Returns the planned subvolumes as solid cubes. `plan` is the subvolume list that the process of
// the job has written to the file `path`; the messages of errors name this file.
std::vector<PartialDag::Part> planned_parts(const nlohmann::json& plan, const std::string& path,
                                            uint64_t resolution) {
  const uint32_t levels = levels_of_resolution(resolution);
  std::vector<PartialDag::Part> parts;
  for (const auto& entry : plan.at("cubes")) {
    const uint64_t edge = entry.at(3).get<uint64_t>();
    const auto is_outside = [&](uint64_t at) { return at >= resolution || at % edge != 0; };
    if (!std::has_single_bit(edge) || edge < uint64_t{kBrickEdge} || edge > resolution ||
        is_outside(entry.at(0)) || is_outside(entry.at(1)) || is_outside(entry.at(2)))
      throw Error(ErrorCode::kCorrupt, path + ": 'cubes' has the entry " + exact_json_text(entry) +
                                           ": expected a cube of the octree, [X,Y,Z,EDGE,BUILT]");
    Cube cube{levels - levels_of_resolution(edge), {}};
    for (size_t axis = 0; axis < 3; ++axis)
      cube.position[axis] = static_cast<uint32_t>(entry.at(axis).get<uint64_t>() / edge);
    parts.push_back({cube, ~uint64_t{0}});
  }
  return parts;
}

// Returns read(plan) for the list of planned subvolumes that the job's process has written.
template <class Read>
auto with_plan(FileSystem& files, const JobFolder& folder, const Read& read) {
  if (!files.exists(folder.subvolumes()))
    throw Error(ErrorCode::kNotFound,
                "the subvolumes are not planned yet: expected a job that has read its scene");
  try {
    return read(
        parse_json<nlohmann::json>(read_own_file(files, folder.subvolumes(), kMaxPlanBytes)));
  } catch (const nlohmann::json::exception&) {
    throw Error(
        ErrorCode::kCorrupt,
        folder.subvolumes() + " is damaged: expected the JSON that the job's process writes");
  }
}

}  // namespace

bool is_planned(FileSystem& files, const JobFolder& folder) {
  return files.exists(folder.work()) && files.exists(folder.subvolumes()) &&
         !files.exists(folder.report());
}

uint64_t read_planned_total(FileSystem& files, const JobFolder& folder) {
  return with_plan(files, folder,
                   [](const nlohmann::json& plan) { return plan.at("total").get<uint64_t>(); });
}

std::string describe_cubes(const CoarseCubes& cubes, uint64_t resolution) {
  const uint32_t levels = levels_of_resolution(resolution);
  nlohmann::json list = nlohmann::json::array();
  for (const auto& [id, coarse] : cubes.cubes()) {
    const Cube& cube = coarse.cube;
    const int64_t edge = cube.edge_voxels(levels);
    list.push_back({cube.position[0] * edge, cube.position[1] * edge, cube.position[2] * edge, edge,
                    static_cast<uint32_t>(coarse.brick),
                    static_cast<uint32_t>(coarse.brick >> 32)});
  }
  const nlohmann::ordered_json json = {{"resolution", resolution},
                                       {"built", cubes.built()},
                                       {"total", cubes.total()},
                                       {"cubes", std::move(list)}};
  return exact_json_text(json);
}

nlohmann::ordered_json read_frame(FileSystem& files, const JobFolder& folder, uint64_t resolution) {
  const uint32_t levels = levels_of_resolution(resolution);
  return with_plan(files, folder, [&](const nlohmann::json& plan) {
    const GridPlace place{plan.at("origin"), plan.at("edge")};
    nlohmann::ordered_json frame = {{"origin", place.origin}, {"edge", place.edge}};
    PartialDag nodes(levels);
    // After one call of add(), the root is the only node of its level. So its offset is 0, which
    // the view of the copy expects.
    if (nodes.add(planned_parts(plan, folder.subvolumes(), resolution))) {
      const PartialDagCopy planned(nodes, levels);
      const CancelToken never;
      query::NamedViews views(planned.view(), never);
      frame["box"] = {{"low", views.box().low.v}, {"high", views.box().high.v}};
      frame["camera"] = camera_of("iso", views, planned.view(), place);
      frame["tall_views"]["iso"] = camera_of("iso", views, planned.view(), place, kTallAspect);
    }
    return frame;
  });
}

}  // namespace voxdag::server
