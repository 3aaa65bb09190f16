// The routes by which a viewer gets a finished DAG in tiles; docs/api.md.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/api/routes/router.h"
#include "server/tiles/viewed_file.h"

namespace voxdag::server {

// The file that a call asks for, and a permit to do so, null if none is needed.
struct Viewed {
  std::shared_ptr<const ViewedFile> file;
  std::shared_ptr<void> permit;
};
// Throws Problem if there is no such file, or no permit is free.
using FindViewedFile = std::function<Viewed(const Call&)>;

// Whether tiles are compressed for clients that accept it. It halves their bytes, at about 80 MB/s
// of one core: a gain on a network, a loss on the loopback.
enum class Packing { kNone, kGzip };

// Adds BASE/tiles, BASE/tiles/batch, BASE/tiles/colors and BASE/tiles/{level}/{offset}.
void add_tile_routes(Router& router, const std::string& base, Packing packing,
                     const FindViewedFile& find);

}  // namespace voxdag::server
