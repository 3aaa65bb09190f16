#include "server/tiles/manifest.h"

#include "server/tiles/tile_source.h"

namespace voxdag::server {
namespace {

using ManifestJson = nlohmann::ordered_json;

ManifestJson point(const query::Vec& voxels, const query::DagView& dag, const GridPlace& place) {
  ManifestJson json = ManifestJson::array();
  for (int axis = 0; axis < 3; ++axis)
    json.push_back(place.origin[static_cast<size_t>(axis)] +
                   voxels[axis] * (place.edge / static_cast<double>(dag.resolution())));
  return json;
}

}  // namespace

nlohmann::ordered_json manifest_of(const query::DagView& dag, const std::string& digest,
                                   const GridPlace& place, std::optional<uint64_t> root) {
  const uint32_t levels = dag.grid_levels();
  ManifestJson json = {{"digest", digest},
                       {"resolution", dag.resolution()},
                       {"levels", levels},
                       {"tile_levels", kTileLevels},
                       {"batch_max", kMaxTilesOfBatch},
                       {"origin", place.origin},
                       {"edge", place.edge},
                       {"root", nullptr}};
  if (!root) return json;
  json["root"] = {{"level", 0}, {"offset", *root}};
  if (levels == kBrickLevels) {
    const uint64_t mask = dag.brick(*root);
    json["root_brick"] = {static_cast<uint32_t>(mask), static_cast<uint32_t>(mask >> 32)};
  }
  return json;
}

nlohmann::ordered_json camera_of(const std::string& view, query::NamedViews& views,
                                 const query::DagView& dag, const GridPlace& place, double aspect) {
  const query::Placement p = views.find(view, aspect, {});
  return {{"position", point(p.eye, dag, place)},
          {"target", point(p.target, dag, place)},
          {"fov_degrees", p.fov_degrees}};
}

query::Placement placement_of(const nlohmann::json& camera, const voxdag_reader::File& file) {
  const auto voxels = [&](const nlohmann::json& point) {
    query::Vec position;
    for (int axis = 0; axis < 3; ++axis)
      position[axis] = (point.at(static_cast<size_t>(axis)).get<double>() - file.origin()[axis]) *
                       static_cast<double>(file.resolution()) / file.edge();
    return position;
  };
  return {voxels(camera.at("position")), voxels(camera.at("target")),
          camera.at("fov_degrees").get<double>()};
}

nlohmann::ordered_json file_manifest(const voxdag_reader::File& file, const query::DagView& dag,
                                     const std::string& digest, const CancelToken& cancel) {
  const GridPlace place{{file.origin()[0], file.origin()[1], file.origin()[2]}, file.edge()};
  ManifestJson json =
      manifest_of(dag, digest, place, dag.empty() ? std::nullopt : std::optional<uint64_t>(0));
  json["voxels"] = std::to_string(file.voxels());
  if (file.has_colors())
    json["colors"] = {{"levels", file.color_levels()}, {"batch_max", kMaxColorPagesOfBatch}};
  if (dag.empty()) return json;
  query::NamedViews views(dag, cancel);
  const query::Box& box = views.box();
  json["box"] = {{"low", box.low.v}, {"high", box.high.v}};
  json["camera"] = camera_of("auto", views, dag, place);
  for (const std::string& view : query::view_names()) {
    if (view == "auto" || view == "inside") continue;
    json["views"][view] = camera_of(view, views, dag, place);
    json["tall_views"][view] = camera_of(view, views, dag, place, kTallAspect);
  }
  return json;
}

}  // namespace voxdag::server
