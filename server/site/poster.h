// The poster of a package: a picture of the scene. The page shows it until the viewer has drawn its
// first picture, and other web sites show it as the preview of a link to the page.
#pragma once

#include <string>

#include "core/base/progress.h"
#include "core/format/global/voxdag_reader.h"
#include "query/package/write_package.h"
#include "voxdag/cancel_token.h"

namespace voxdag::server {

// The size of a poster in pixels. Web sites show a picture of at least 600 x 315 pixels in a large
// preview.
inline constexpr int kPosterWidth = 640, kPosterHeight = 336;

struct PosterFormat {
  const char* ending;  // of the file's name
  const char* media_type;
};
// Returns the format of a poster, determined from its first bytes.
PosterFormat format_of_poster(const std::string& poster);

// Renders the view of spec.camera, and returns a JPEG file, or a PNG file if this program was built
// without libjpeg. Returns "" if the file has no voxels. Throws
// Error{kCorrupt} for a damaged file, and Error{kCanceled}.
std::string render_poster(const voxdag_reader::File& file, const query::PackageSpec& spec,
                          Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::server
