// Divides a grid, and also coarser levels of it, into cubes of equal size, the chunks, and exports
// each chunk to its own file. Game engines load such chunks by distance. A manifest lists all
// chunks.
//
//     FOLDER/manifest.json
//     FOLDER/L10/3_0_7.vox     the chunk at (3, 0, 7) of level 10, in chunks
#pragma once

#include <cstdint>
#include <string>

#include "query/export/export.h"

namespace voxdag::query {

struct ChunksRequest {
  // `selection` is on the finest level to export. `output` is the folder.
  ExportRequest request;
  uint64_t edge = 256;  // cells per edge of a chunk, on every level; a power of two from 4 on
  uint64_t levels = 1;  // exported levels: the selected one and the next coarser ones
};

struct ChunksReport {
  std::string manifest;  // path of the manifest
  uint64_t chunks = 0;   // files of chunks; chunks without voxels have none
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
