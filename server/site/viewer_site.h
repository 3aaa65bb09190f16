// The viewer of a package (query/package/package_index.h): its page and its JavaScript module.
#pragma once

#include <string>
#include <vector>

#include "query/package/write_package.h"

namespace voxdag::server {

// The contents of a page, besides the viewer.
struct PageContents {
  std::string title;
  std::string poster;  // a JPEG or PNG file (poster.h); "" for no poster
  // The URL of the published folder, which ends with a slash; "" if it is unknown. Other web sites
  // find the poster only with this URL.
  std::string url;
};

// Returns the files of the viewer: index.html, the module with its JavaScript, and the poster. The
// page shows the package that is in the same folder as the page.
std::vector<query::ViewerFile> viewer_site(const PageContents& contents);

// Returns a page that contains the module of the viewer and the poster, for `publish
// --single-file`. The module reads the files of the package from elements <script
// type="text/plain" data-file=NAME> in the page, which the caller must insert. These elements
// contain the bytes of the files in base64.
std::string page_with_module(const PageContents& contents);

}  // namespace voxdag::server
