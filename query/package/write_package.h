// Writes the tiles and color pages of a global file as a package (package_index.h). The bytes of
// the package depend only on the voxels and colors, on the members `manifest`, `camera`, `colors`
// and `pack_bytes` of PackageSpec, on the files of the viewer, and on the version of zlib.
//
// Several threads encode the blocks of a band. PackageSpec::memory_bytes limits the memory. Only
// the tile numbers of one band must fit in it (tile_numbers.h); other data is read in parts.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/file_system.h"
#include "query/package/package_index.h"
#include "query/render/camera.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// A file of the viewer. All names except index.html contain the hash of the contents
// (hashed_name()).
struct ViewerFile {
  std::string name;
  std::string contents;
};

struct PackageSpec {
  std::string output;  // path of the package's folder
  // The manifest for viewers (docs/api.md), as JSON. write_package() adds the digest. The member
  // "tile_levels" must be kPackageTileLevels.
  std::string manifest;
  // The camera with which the viewer begins, in voxels. The head of the package has the tiles of
  // its first picture (first_tiles.h). Without a camera, the package has no head.
  std::optional<Placement> camera;
  bool colors = true;  // also write the colors, if the file has any
  uint64_t pack_bytes = uint64_t{8} << 20;
  uint64_t memory_bytes = uint64_t{1} << 30;
  unsigned threads = 1;
  // Additional limit for the memory of a list of nodes, which otherwise gets a fixed share of
  // memory_bytes. Tests use a small limit.
  uint64_t list_bytes = ~uint64_t{0};
};

struct PackageReport {
  uint64_t bytes = 0;  // total size of all files
  uint64_t files = 0;
  uint64_t packs = 0;
  uint64_t tiles = 0;
  uint64_t color_pages = 0;
  uint64_t blocks = 0;
  std::string digest;
};

// A function that returns the files of the viewer: index.html, and files whose names contain the
// hash of their contents.
using ViewerMaker = std::function<std::vector<ViewerFile>()>;

// Writes the package. Calls `make_viewer` only after it has checked and locked the output folder,
// because `make_viewer` can take long: it renders a picture. For a package without a viewer,
// `make_viewer` is empty.
// Throws Error:
// - the errors of PackageFolder and of `make_viewer`;
// - kCorrupt for a damaged file; kNoSpace, kOutOfMemory, kCanceled.
PackageReport write_package(const voxdag_reader::File& file, const PackageSpec& spec,
                            const ViewerMaker& make_viewer, FileSystem& files, Progress& progress,
                            const CancelToken& cancel);

}  // namespace voxdag::query
