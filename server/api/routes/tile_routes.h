// The routes by which a viewer gets a DAG in tiles; docs/api.md.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/api/routing/router.h"
#include "server/tiles/tile_source.h"

namespace voxdag::server {

// The DAG that a call asks for, and a permit to do so, null if none is needed.
struct TileAccess {
  std::shared_ptr<const TileSource> dag;
  std::shared_ptr<void> permit;
};
// Throws Problem for an unknown job or file, or if no permit is free.
using OpenTiles = std::function<TileAccess(const Call&)>;

// True if tiles are compressed for clients that accept it. It halves their bytes, at about 80 MB/s
// of one core: a gain on a network, a loss on the loopback.
enum class Packing { kNone, kGzip };

enum class Colors { kNone, kServed };

struct TileRoutes {
  std::string base;     // "/api/v1/jobs/{id}"
  std::string id;       // part of the operations' ids
  std::string subject;  // begin of the operations' summaries
  std::string manifest_schema;
  Packing packing = Packing::kGzip;
  Colors colors = Colors::kServed;
};

// Adds BASE/tiles, BASE/tiles/batch and BASE/tiles/{level}/{offset}, and BASE/tiles/colors if they
// are served. Manifests in the making are given up when `stopping` is canceled; it must outlive the
// router.
void add_tile_routes(Router& router, const TileRoutes& routes, const OpenTiles& open,
                     const CancelToken& stopping);

}  // namespace voxdag::server
