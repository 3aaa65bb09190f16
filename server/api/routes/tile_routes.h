// The routes for reading a DAG in tiles; docs/api.md.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/api/routing/router.h"
#include "server/jobs/protocol/spell_options.h"
#include "server/tiles/tile_source.h"

namespace voxdag::server {

// The DAG that a call requests, and a permit for the work. The permit is null if none is needed.
struct TileAccess {
  std::shared_ptr<const TileSource> dag;
  std::shared_ptr<void> permit;
};
// Opens the DAG that a call requests. Throws Problem for an unknown job or file, or if no permit is
// free.
using OpenTiles = std::function<TileAccess(const Call&)>;

// kGzip compresses tiles for clients that accept gzip. Compression halves the bytes of tiles and
// runs at about 80 MB/s per core. So clients on a network get tiles faster with kGzip, but clients
// on the loopback get them more slowly.
enum class Packing { kNone, kGzip };

enum class Colors { kNone, kServed };

struct TileRoutes {
  std::string base;     // start of the paths, such as "/api/v1/jobs/{id}"
  std::string id;       // part of the OpenAPI operation ids
  std::string subject;  // start of the OpenAPI operation summaries
  std::string manifest_schema;
  Packing packing = Packing::kGzip;
  Colors colors = Colors::kServed;
  std::string file_name = {};  // "name" in the manifest; "": no such member
  // The users who read the messages. Clients of jobs have no file, so no command can check it.
  const Audience* audience = &kJobUsers;
};

// Adds BASE/tiles, BASE/tiles/batch, BASE/tiles/{level}/{offset} and, if colors are served,
// BASE/tiles/colors. When `stopping` is canceled, the routes abandon manifests that are being
// computed. `stopping` must outlive the router.
void add_tile_routes(Router& router, const TileRoutes& routes, const OpenTiles& open,
                     const CancelToken& stopping);

}  // namespace voxdag::server
