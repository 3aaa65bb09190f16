// Finds the cutouts of a scene: decodes the images of materials with the alpha modes MASK and BLEND
// to masks of their visible texels.
#pragma once

#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/color/cutouts/cutouts.h"
#include "core/format/checksum.h"
#include "core/io/file_system.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Decodes on up to `threads` threads. A material whose image is unreadable has only the alpha of
// its factor; for each such image, `problems` gets a warning. The masks are charged to `budget`.
// Throws the errors of TextureSet::prepare().
Cutouts find_cutouts(FileSystem& files, const SceneMaterials& materials, unsigned threads,
                     MemoryBudget& budget, const CancelToken& cancel, WarningList& problems);

// Returns the files of the images that decide which parts of triangles are cut out. For an image
// whose file cannot be opened, the SourceFile has no identity.
std::vector<SourceFile> cutout_files(const SceneMaterials& materials);

// True if at least one material has an alpha mode that can cut out triangles or parts of triangles.
bool may_have_cutouts(const SceneMaterials& materials);

// Returns a digest of everything that decides which parts of a scene's triangles are cut out.
Checksum128 cutout_digest(const Cutouts& cutouts);

// Returns the materials with a separate image for each mask, so that the image can be decoded
// without the texels that the mask hides.
SceneMaterials with_separate_images(SceneMaterials materials, const Cutouts& cutouts);

// Returns the number of materials that may have cutouts. Vertex colors and images are not read.
uint64_t count_cutout_materials(const SceneMaterials& materials);

}  // namespace voxdag
