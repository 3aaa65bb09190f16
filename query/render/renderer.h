// Renders a picture of a DAG on several threads. The pixels do not depend on the number of threads.
#pragma once

#include "core/base/progress.h"
#include "query/dag/dag_view.h"
#include "query/render/camera.h"
#include "query/render/g_buffer.h"
#include "query/render/picture.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

struct RenderOptions {
  int width = 1280, height = 720;
  int samples = 2;  // along each side of a pixel: samples^2 samples per pixel
  unsigned threads = 1;
  // The DAG's file, for its colors; null for gray.
  const voxdag_reader::File* colors = nullptr;
};

// Bytes that render_picture() allocates per pixel, including the picture.
inline constexpr uint64_t kRenderBytesPerPixel = sizeof(GBufferPixel) + 3;

// Renders a picture. If the DAG is empty, the picture shows a plain background. Throws
// Error{kCorrupt} for a damaged DAG, and Error{kCanceled}.
Picture render_picture(const DagView& dag, const Placement& placement, const RenderOptions& options,
                       Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
