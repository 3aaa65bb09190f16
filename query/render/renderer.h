// Renders a picture of a DAG on several threads. The pixels do not depend on the number of threads.
#pragma once

#include <string>
#include <vector>

#include "core/base/progress.h"
#include "query/dag/dag_view.h"
#include "query/render/albedo.h"
#include "query/render/camera.h"
#include "query/render/g_buffer.h"
#include "query/render/picture.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// The background, which pixels without a surface show: a gradient, white, or transparency. The
// scene casts a shadow on a gradient or white background, but not on a transparent one.
enum class Background { kSky, kWhite, kTransparent };
// Returns "sky", "white" and "transparent".
const std::vector<std::string>& background_names();
// Throws Error{kInvalidInput} for an unknown name.
Background background_named(const std::string& name);

struct RenderOptions {
  int width = 1280, height = 720;
  int samples = 2;  // along each side of a pixel: samples^2 samples per pixel
  unsigned threads = 1;
  Background background = Background::kSky;
  // The file whose colors are shown; null for gray surfaces.
  const voxdag_reader::File* colors = nullptr;
  // Any value except kColor replaces the colors. kNormal also omits light and haze.
  Shade shade = Shade::kColor;
};

// Returns the number of channels of a picture. Each channel has one byte.
constexpr int channels_of(Background background) {
  return background == Background::kTransparent ? 4 : 3;
}
// Bytes that render_picture() allocates per pixel, including the picture.
constexpr uint64_t render_bytes_per_pixel(Background background) {
  return sizeof(GBufferPixel) + static_cast<uint64_t>(channels_of(background));
}

// Renders a picture. The picture has alpha if the background is transparent. If the DAG is empty,
// the picture shows only the background. Throws Error{kCorrupt} for a damaged DAG, and
// Error{kCanceled}.
Picture render_picture(const DagView& dag, const Placement& placement, const RenderOptions& options,
                       Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
