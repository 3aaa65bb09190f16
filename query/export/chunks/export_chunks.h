// Exports a file as many small files: one for each cube of the grid, also on coarser levels.
// Engines load such chunks by distance. A manifest lists them.
//
//     FOLDER/manifest.json
//     FOLDER/L10/3_0_7.vox     the chunk (3, 0, 7) of level 10
#pragma once

#include <cstdint>
#include <string>

#include "query/export/export.h"

namespace voxdag::query {

struct ChunksRequest {
  // The selection is that of the finest level. `output` is the folder.
  ExportRequest request;
  uint64_t edge = 256;  // cells per edge of a chunk, on every level; a power of two of at least 4
  uint64_t levels = 1;  // number of levels, from the selected one to coarser ones
};

struct ChunksReport {
  std::string manifest;  // its path
  uint64_t chunks = 0;   // chunks with voxels; only these have files
  uint64_t voxels = 0;   // in all chunks of all levels
  uint64_t bytes = 0;    // of all files, without the manifest
};

// Writes the chunks that have voxels, and then the manifest. Chunks without voxels have no files.
// The folder must not exist, or must be empty unless the request replaces files. After an error, no
// file of this call remains. Throws the errors of export_dag().
ChunksReport export_chunks(FileSystem& files, const voxdag_reader::File& file,
                           const ChunksRequest& request, Progress& progress,
                           const CancelToken& cancel);

}  // namespace voxdag::query
