#include "server/site/poster.h"

#include "core/image/jpeg_writer.h"
#include "query/dag/dag_view.h"
#include "query/render/renderer.h"

namespace voxdag::server {

PosterFormat format_of_poster(const std::string& poster) {
  return poster.starts_with("\xff\xd8") ? PosterFormat{".jpg", "image/jpeg"}
                                        : PosterFormat{".png", "image/png"};
}

std::string render_poster(const voxdag_reader::File& file, const query::PackageSpec& spec,
                          Progress& progress, const CancelToken& cancel) {
  const query::DagView dag(file);
  if (dag.empty()) return "";
  query::RenderOptions options;
  options.width = kPosterWidth;
  options.height = kPosterHeight;
  options.threads = spec.threads;
  options.colors = spec.colors ? &file : nullptr;
  const query::Picture picture =
      query::render_picture(dag, spec.camera.value(), options, progress, cancel);
  // A JPEG file of a textured scene has about a quarter of the bytes of a PNG file.
  return query::encode_picture(picture, can_write_jpeg() ? "poster.jpg" : "poster.png");
}

}  // namespace voxdag::server
