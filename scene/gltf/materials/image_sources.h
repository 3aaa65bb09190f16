// Finds the images of a document: in a buffer, in a data: URI, or in an external file.
#pragma once

#include "core/base/memory_budget.h"
#include "scene/triangle_source.h"

namespace voxdag::gltf {

struct Document;

// Finds image `index` of the document's model and opens its file. Stores an error in the result's
// `problem`.
ImageSource find_image(FileSystem& files, const ReadableFile& scene_file, const Document& document,
                       int index);

}  // namespace voxdag::gltf
