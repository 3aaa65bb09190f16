// A client of the service: requests over HTTP or HTTPS to one server, used by the client commands.
// One request at a time; a connection is kept between requests. httplib stays behind this header.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

namespace voxdag::client {

// Header fields by name; those of an answer have their names in lower case.
using HeaderMap = std::multimap<std::string, std::string>;

struct ClientResponse {
  int status = 0;
  HeaderMap headers;
  std::string body;  // empty if it went to a sink
  // The first header of the name, whatever its case; "" if there is none.
  std::string header(std::string_view name) const;
};

struct ClientOptions {
  std::string url;        // http://host:port or https://host[:port], no path
  std::string token;      // "" for none
  std::string ca_file;    // certificates to trust instead of the system's; "" for the system's
  double timeout_s = 30;  // to connect, and of silence while reading or writing
};

// All throw Error{kIo} if the server cannot be reached or the connection breaks, and
// Error{kInvalidInput} for a URL that is not one. HTTP errors are answers like others.
class HttpClient {
 public:
  explicit HttpClient(const ClientOptions& options);
  ~HttpClient();

  ClientResponse get(const std::string& path, const HeaderMap& headers = {});
  ClientResponse head(const std::string& path, const HeaderMap& headers = {});
  // `method` is POST, PUT, PATCH or DELETE; a body that is not empty is sent as application/json.
  ClientResponse send(const std::string& method, const std::string& path, const std::string& body,
                      const HeaderMap& headers = {});

  // PUTs `size` bytes, asked for with source(offset, most) -> a piece that is not empty.
  using Source = std::function<std::string(uint64_t offset, uint64_t most)>;
  ClientResponse upload(const std::string& path, uint64_t size, const Source& source,
                        const HeaderMap& headers = {});

  // GETs a long body in pieces; for downloads and event streams. `begin` sees status and headers;
  // it and `sink` return false to hang up, which is no error. The body of an answer of 400 and
  // above is kept in the response instead of going to the sink.
  using Begin = std::function<bool(const ClientResponse&)>;
  using Sink = std::function<bool(std::string_view piece)>;
  ClientResponse stream(const std::string& path, const HeaderMap& headers, const Begin& begin,
                        const Sink& sink);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Throws the Error that a problem+json answer (status 400 and above) tells of; returns otherwise.
void throw_if_problem(const ClientResponse& response);

}  // namespace voxdag::client
