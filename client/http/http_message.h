// The answer of an HTTP server, and the options of a connection to it.
#pragma once

#include <map>
#include <string>
#include <string_view>

namespace voxdag::client {

// Converts only ASCII letters, independent of the locale.
inline std::string lower_case(std::string_view name) {
  std::string lower(name);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c + ('a' - 'A'));
  return lower;
}

// Header fields by name. In an answer, names are in lower case.
using HeaderMap = std::multimap<std::string, std::string>;

struct ClientResponse {
  int status = 0;
  HeaderMap headers;
  std::string body;  // empty if a sink received it
  // Returns the value of the first header field with this name, ignoring case; "" if no field has
  // the name.
  std::string header(std::string_view name) const {
    const auto found = headers.find(lower_case(name));
    return found == headers.end() ? "" : found->second;
  }
};

struct ClientOptions {
  std::string url;               // http://host:port or https://host[:port], without a path
  std::string token;             // "": no token
  std::string ca_file;           // file of certificates to trust; "": the system's certificates
  double timeout_s = 30;         // limit for connecting, and for each read and write
  double connect_timeout_s = 0;  // if not 0, replaces timeout_s for connecting
};

}  // namespace voxdag::client
