// The files of the viewer for a package (query/package): its page and its modules.
#pragma once

#include <string>
#include <vector>

#include "query/package/write_package.h"

namespace voxdag::server {

// Returns index.html and one module with all modules of the viewer. The page has the title and
// finds the package in its folder.
std::vector<query::ViewerFile> viewer_site(const std::string& title);

// Returns the page with the module in it. It finds the files of the package in the page, in
// elements <script type="text/plain" data-file=NAME> with their base64.
std::string page_with_module(const std::string& title);

}  // namespace voxdag::server
