// URLs of webhooks, and the prefixes of URLs that the operator allows.
#pragma once

#include <string>
#include <string_view>

namespace voxdag::server {

struct HttpUrl {
  std::string scheme;  // "http" or "https"
  std::string host;    // in lower case; an IPv6 address has brackets
  int port = 0;
  std::string target;  // path and query, begins with '/'

  // Returns "https://host:port", without a path.
  std::string origin() const;
  // Returns the target without the query.
  std::string path() const { return target.substr(0, target.find('?')); }
};

// Parses a URL of at most 1024 characters. Throws Error{kInvalidInput}, whose message names the
// part that is wrong. Refuses user names and passwords, fragments, characters that a URL must
// encode, and paths that a receiver could resolve to another folder: segments "." and ".." (also
// with path parameters, as in "..;x"), backslashes, and encoded slashes, percent signs and control
// characters.
HttpUrl parse_http_url(std::string_view text);

// True if the URL has the same scheme, host and port as the prefix, and its path is the path of the
// prefix or is in the folder that this path names. The prefix "http://host/a" allows
// "http://host/a/b" but not "http://host/ab".
bool is_below(const HttpUrl& url, const HttpUrl& prefix);

}  // namespace voxdag::server
