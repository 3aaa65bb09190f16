// Renders a picture on several threads; the same pixels for any number of them.
#pragma once

#include "cli/render/camera.h"
#include "cli/render/dag_view.h"
#include "cli/render/picture.h"
#include "core/base/cancel_token.h"
#include "core/base/progress.h"

namespace voxdag::render {

struct RenderOptions {
  int width = 1280, height = 720;
  int samples = 2;  // along each side of a pixel
  int threads = 1;
};

// Throws Error{kCorrupt} for a DAG that is damaged, Error{kCancelled}.
Picture render_picture(const DagView& dag, const Placement& placement, const RenderOptions& options,
                       Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::render
