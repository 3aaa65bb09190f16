#include "server/site/viewer_site.h"

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "query/package/gzip_block.h"
#include "server/site/base64.h"
#include "server/site/module_bundle.h"
#include "server/site/poster.h"
#include "server/web/assets.h"

namespace voxdag::server {
namespace {

const std::string& asset(const std::string& name) {
  for (const Asset& asset : embedded_assets())
    if (asset.name == name) return asset.contents;
  throw std::logic_error("the viewer has no file " + name);
}

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '&')
      result += "&amp;";
    else if (c == '<')
      result += "&lt;";
    else if (c == '>')
      result += "&gt;";
    else if (c == '"')
      result += "&quot;";
    else
      result += c;
  }
  return result;
}

// True if a line of viewer.html must be left out of the page of a package. Such a line refers to
// other files or pages of the service, or has the title of the service's page.
bool is_of_service(const std::string& line) {
  constexpr const char* kParts[] = {"<link ", "<script ", "<title>", "id=\"home\"",
                                    "<!-- Loads the modules"};
  return std::ranges::any_of(kParts,
                             [&](const char* part) { return line.find(part) != line.npos; });
}

// Returns viewer.html without the lines for which is_of_service() is true. Inserts `head` at the
// end of its element <head>, and `poster` over the picture.
std::string page_of(const std::string& head, const std::string& poster) {
  std::istringstream lines(asset("viewer.html"));
  std::string page;
  for (std::string line; std::getline(lines, line);) {
    if (is_of_service(line)) continue;
    if (line == "</head>") page += head;
    if (line.find("id=\"status\"") != line.npos) page += poster;
    page += line + '\n';
  }
  return page;
}

std::string percent_encoded(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '%')
      result += "%25";
    else if (c == '#')
      result += "%23";
    else if (c == '"')
      result += "%22";
    else if (c == '<')
      result += "%3c";
    else if (c == '>')
      result += "%3e";
    else if (c != '\n')
      result += c;
  }
  return result;
}

// Returns the element that shows the poster until the viewer has drawn (web/viewer/app.js). The
// other files of the page are more urgent than the poster.
std::string poster_element(const std::string& url) {
  if (url.empty()) return "";
  return "      <img id=\"poster\" class=\"poster\" src=\"" + url +
         "\" alt=\"\" fetchpriority=\"low\">\n";
}

// Returns the elements that describe the page to other web sites, which show a preview of it
// (https://ogp.me). `poster` is the name of the poster's file, or "".
std::string preview_elements(const PageContents& contents, const std::string& poster) {
  const auto element = [](const std::string& property, const std::string& content) {
    return "  <meta property=\"og:" + property + "\" content=\"" + escaped(content) + "\">\n";
  };
  std::string elements = element("title", contents.title) + element("type", "website");
  if (!contents.url.empty()) elements += element("url", contents.url);
  if (poster.empty()) return elements;
  return elements + element("image", contents.url + poster) +
         element("image:width", std::to_string(kPosterWidth)) +
         element("image:height", std::to_string(kPosterHeight)) +
         "  <meta name=\"twitter:card\" content=\"summary_large_image\">\n";
}

// Returns the content of the element <head> for the page of a package. `url` is the URL of the
// folder of the package (web/viewer/package/published.js). `elements` are further elements, among
// them the element <script> that starts the viewer.
std::string head_of(const std::string& title, const std::string& url, const std::string& elements) {
  std::string head = "  <title>" + escaped(title) + "</title>\n";
  head += "  <meta name=\"voxdag-package\" content=\"" + url + "\">\n";
  head += "  <link rel=\"icon\" href=\"data:image/svg+xml," + percent_encoded(asset("icon.svg")) +
          "\">\n";
  head += elements + "  <style>\n";
  for (const char* name : {"app.css", "parts.css", "viewer.css"}) head += asset(name);
  return head + "  </style>\n";
}

std::string viewer_module() { return bundle_modules("viewer/package/main.js", asset); }
std::string start_module() { return bundle_modules("viewer/package/start.js", asset); }

}  // namespace

std::vector<query::ViewerFile> viewer_site(const PageContents& contents) {
  const std::string module = viewer_module(), compressed = query::gzip_block(module),
                    start = start_module();
  std::vector<query::ViewerFile> files = {
      {query::hashed_name("start", start, ".js"), start},
      {query::hashed_name("viewer", compressed, ".bin"), compressed},
      {query::hashed_name("viewer", module, ".js"), module}};
  // Without the preload, the browser would request the module only after start.js has arrived.
  const std::string scripts =
      "  <link rel=\"preload\" href=\"" + files[1].name +
      "\" as=\"fetch\" crossorigin>\n  <meta name=\"voxdag-viewer\" content=\"" + files[1].name +
      " " + files[2].name + "\">\n  <script type=\"module\" src=\"" + files[0].name +
      "\"></script>\n";
  std::string poster;
  if (!contents.poster.empty()) {
    poster =
        query::hashed_name("poster", contents.poster, format_of_poster(contents.poster).ending);
    files.push_back({poster, contents.poster});
  }
  const std::string head =
      head_of(contents.title, "./", preview_elements(contents, poster) + scripts);
  files.push_back({"index.html", page_of(head, poster_element(poster))});
  return files;
}

std::string page_with_module(const PageContents& contents) {
  const std::string scripts = "  <script type=\"module\">\n" + start_module() +
                              "</script>\n  <script type=\"text/plain\" data-module>" +
                              base64_of(query::gzip_block(viewer_module())) + "</script>\n";
  const std::string poster = contents.poster.empty()
                                 ? ""
                                 : std::string("data:") +
                                       format_of_poster(contents.poster).media_type + ";base64," +
                                       base64_of(contents.poster);
  return page_of(head_of(contents.title, "", scripts), poster_element(poster));
}

}  // namespace voxdag::server
