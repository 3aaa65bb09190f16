#include "server/site/poster.h"

#include <nlohmann/json.hpp>

#include "core/fields/json_text.h"
#include "core/image/jpeg_writer.h"
#include "query/dag/dag_view.h"
#include "query/render/renderer.h"

namespace voxdag::server {
namespace {

// Returns the manifest's camera in voxels.
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

}  // namespace

PosterFormat format_of_poster(const std::string& poster) {
  return poster.starts_with("\xff\xd8") ? PosterFormat{".jpg", "image/jpeg"}
                                        : PosterFormat{".png", "image/png"};
}

std::string render_poster(const voxdag_reader::File& file, const query::PackageSpec& spec,
                          Progress& progress, const CancelToken& cancel) {
  const query::DagView dag(file);
  if (dag.empty()) return "";
  const auto manifest = parse_json<nlohmann::json>(spec.manifest);
  query::RenderOptions options;
  options.width = kPosterWidth;
  options.height = kPosterHeight;
  options.threads = spec.threads;
  options.colors = spec.colors ? &file : nullptr;
  const query::Picture picture = query::render_picture(
      dag, placement_of(manifest.at("camera"), file), options, progress, cancel);
  // A JPEG file of a textured scene has about a quarter of the bytes of a PNG file.
  return query::encode_picture(picture, can_write_jpeg() ? "poster.jpg" : "poster.png");
}

}  // namespace voxdag::server
