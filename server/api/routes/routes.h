// The routes of the service, by topic.
#pragma once

#include "server/api/routing/router.h"

namespace voxdag::server {

void add_job_routes(Router& router);
void add_result_routes(Router& router);
// The tiles of finished jobs' results, and of unfinished jobs.
void add_job_tile_routes(Router& router);
void add_event_routes(Router& router);
void add_scene_routes(Router& router);
void add_system_routes(Router& router);
// Adds "/NAME" for each file that is compiled in, and "/" for `start_page`.
void add_asset_routes(Router& router, const std::string& start_page);
// Adds "/openapi.json", the description of all routes of the router, which must outlive it.
void add_document_route(Router& router);

}  // namespace voxdag::server
