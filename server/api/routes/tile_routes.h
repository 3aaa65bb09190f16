// The routes by which a viewer gets a DAG in tiles; docs/api.md.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/api/routes/router.h"
#include "server/tiles/viewed_dag.h"

namespace voxdag::server {

// The DAG that a call asks for, and a permit to do so, null if none is needed.
struct Viewed {
  std::shared_ptr<const ViewedDag> dag;
  std::shared_ptr<void> permit;
};
// Throws Problem if there is none, or no permit is free.
using FindViewed = std::function<Viewed(const Call&)>;

// Whether tiles are compressed for clients that accept it. It halves their bytes, at about 80 MB/s
// of one core: a gain on a network, a loss on the loopback.
enum class Packing { kNone, kGzip };

enum class Colors { kNone, kServed };

// Adds BASE/tiles, BASE/tiles/batch and BASE/tiles/{level}/{offset}, and BASE/tiles/colors if they
// are served. Manifests that are being made when `stopping` is canceled are given up; it must
// outlive the router.
void add_tile_routes(Router& router, const std::string& base, Packing packing, Colors colors,
                     const FindViewed& find, const CancelToken& stopping);

}  // namespace voxdag::server
