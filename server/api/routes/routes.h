// The routes of the service, by topic.
#pragma once

#include "server/api/routing/router.h"

namespace voxdag::server {

void add_job_routes(Router& router);
void add_result_routes(Router& router);
void add_export_routes(Router& router);
// Adds the routes for the tiles of finished results and of unfinished jobs.
void add_job_tile_routes(Router& router);
void add_event_routes(Router& router);
void add_scene_routes(Router& router);
void add_system_routes(Router& router);
// Adds a route "/NAME" for each file that is compiled into the program, and "/" for the file
// `start_page`. `embedders` lists the origins whose pages may show the viewer in a frame. It is a
// source list of a Content-Security-Policy, or "" for no origins. The URL of a viewer in a frame
// must have the query parameter "embed".
void add_asset_routes(Router& router, const std::string& start_page, const std::string& embedders);
// Adds "/openapi.json", which describes all routes of `router`. `router` must outlive this route.
void add_document_route(Router& router);

}  // namespace voxdag::server
