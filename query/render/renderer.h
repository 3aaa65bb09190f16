// Renders a picture on several threads; the same pixels for any number of them.
#pragma once

#include "core/base/cancel_token.h"
#include "core/base/progress.h"
#include "query/dag_view.h"
#include "query/render/camera.h"
#include "query/render/picture.h"

namespace voxdag::query {

struct RenderOptions {
  int width = 1280, height = 720;
  int samples = 2;  // along each side of a pixel
  int threads = 1;
};

// Throws Error{kCorrupt} for a DAG that is damaged, Error{kCanceled}.
Picture render_picture(const DagView& dag, const Placement& placement, const RenderOptions& options,
                       Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
