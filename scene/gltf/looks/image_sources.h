// Where the images of a document lie: inside of a buffer, in a data: URI or in a file of their own.
#pragma once

#include "core/base/memory_budget.h"
#include "scene/triangle_source.h"

namespace voxdag::gltf {

struct Document;

// Image `index` of the document's model. Opens its file; what is wrong is its `problem`.
ImageSource find_image(FileSystem& files, const ReadableFile& scene_file, const Document& document,
                       int index);

}  // namespace voxdag::gltf
