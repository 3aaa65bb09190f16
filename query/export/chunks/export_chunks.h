// Divides a grid, and optionally coarser levels of the grid, into cubes of equally many cells, the
// chunks, and exports each chunk to its own file. Game engines load such chunks when the viewer
// comes close. A manifest lists all chunks.
//
//     FOLDER/manifest.json
//     FOLDER/L10/3_0_7.vox     level 10; the low corner is at (3, 0, 7) times a chunk's edge
#pragma once

#include <cstdint>
#include <string>

#include "query/export/export.h"

namespace voxdag::query {

struct ChunksRequest {
  // `request.selection` is on the finest level to export. `request.output` is the folder.
  ExportRequest request;
  uint64_t edge = 256;  // cells per edge of a chunk, on every level; a power of two, at least 4
  uint64_t levels = 1;  // exported levels: the selected one and the next coarser ones
};

struct ChunksReport {
  std::string manifest;  // path of the manifest
  uint64_t chunks = 0;   // number of chunk files; chunks without voxels have no file
  uint64_t voxels = 0;   // sum over all chunks of all levels
  uint64_t bytes = 0;    // total size of all chunk files
};

// Writes one file for each chunk that has voxels, and then the manifest. The folder must be new or
// empty, unless `request.request.replace` is true. After an error, removes all files that this call
// has written. Throws the errors of export_dag().
ChunksReport export_chunks(FileSystem& files, const voxdag_reader::File& file,
                           const ChunksRequest& request, Progress& progress,
                           const CancelToken& cancel);

}  // namespace voxdag::query
