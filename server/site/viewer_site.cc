#include "server/site/viewer_site.h"

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "server/site/module_bundle.h"
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

// True if the page of a package does not contain this line of viewer.html, because the line refers
// to other files or pages of the service, or has the title of the service's page.
bool is_of_service(const std::string& line) {
  constexpr const char* kParts[] = {"<link ", "<script ", "<title>", "id=\"home\"",
                                    "<!-- Loads the modules"};
  return std::ranges::any_of(kParts,
                             [&](const char* part) { return line.find(part) != line.npos; });
}

// Returns viewer.html without the lines for which is_of_service() is true. Inserts `head` at the
// end of its element <head>.
std::string page_with_head(const std::string& head) {
  std::istringstream lines(asset("viewer.html"));
  std::string page;
  for (std::string line; std::getline(lines, line);) {
    if (is_of_service(line)) continue;
    if (line == "</head>") page += head;
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

// Returns the content of the element <head> for the page of a package. `url` is the URL of the
// folder of the package (web/viewer/package/published.js). `script` is the element <script> with
// the viewer.
std::string head_of(const std::string& title, const std::string& url, const std::string& script) {
  std::string head = "  <title>" + escaped(title) + "</title>\n";
  head += "  <meta name=\"voxdag-package\" content=\"" + url + "\">\n";
  head += "  <link rel=\"icon\" href=\"data:image/svg+xml," + percent_encoded(asset("icon.svg")) +
          "\">\n";
  head += script + "  <style>\n";
  for (const char* name : {"app.css", "parts.css", "viewer.css"}) head += asset(name);
  return head + "  </style>\n";
}

std::string viewer_module() { return bundle_modules("viewer/package/main.js", asset); }

}  // namespace

std::vector<query::ViewerFile> viewer_site(const std::string& title) {
  const std::string module = viewer_module();
  const std::string name = query::hashed_name("viewer", module, ".js");
  const std::string script = "  <script type=\"module\" src=\"" + name + "\"></script>\n";
  return {{name, module}, {"index.html", page_with_head(head_of(title, "./", script))}};
}

std::string page_with_module(const std::string& title) {
  const std::string script = "  <script type=\"module\">\n" + viewer_module() + "</script>\n";
  return page_with_head(head_of(title, "", script));
}

}  // namespace voxdag::server
