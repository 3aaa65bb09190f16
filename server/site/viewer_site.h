// The viewer of a package (query/package/package_index.h): its page and its JavaScript module.
#pragma once

#include <string>
#include <vector>

#include "query/package/write_package.h"

namespace voxdag::server {

// Returns two files: index.html, and the module with the JavaScript of the viewer. The page has the
// title `title` and shows the package in its own folder.
std::vector<query::ViewerFile> viewer_site(const std::string& title);

// Returns a page that contains the module of the viewer, for `publish --single-file`. The module
// reads the files of the package from elements <script type="text/plain" data-file=NAME> in the
// page, which the caller must insert. These elements contain the bytes of the files in base64.
std::string page_with_module(const std::string& title);

}  // namespace voxdag::server
