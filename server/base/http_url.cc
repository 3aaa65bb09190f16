#include "server/base/http_url.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxChars = 1024;
constexpr std::string_view kHostChars = "abcdefghijklmnopqrstuvwxyz0123456789.-_";
constexpr std::string_view kAddressChars = "0123456789abcdef:.";  // of IPv6
// The characters of RFC 3986 in a path and a query, and the percent sign.
constexpr std::string_view kTargetChars =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~:/?@!$&'()*+,;=%";

void require(bool holds, const std::string& expected) {
  if (!holds) throw Error(ErrorCode::kInvalidInput, "expected " + expected);
}

bool has_only(std::string_view text, std::string_view chars) {
  return text.find_first_not_of(chars) == std::string_view::npos;
}

std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c + ('a' - 'A'));
  return lower;
}

// Removes the port from `authority`, and returns it.
int take_port(std::string_view& authority, int default_port) {
  const size_t colon = authority.rfind(':');
  if (colon == std::string_view::npos || authority.find(']', colon) != std::string_view::npos)
    return default_port;
  const auto port = parse_numbers<int, 1>(authority.substr(colon + 1), ',');
  require(port && (*port)[0] >= 1 && (*port)[0] <= 65535, "a port from 1 to 65535");
  authority = authority.substr(0, colon);
  return (*port)[0];
}

void check_url_host(const std::string& host) {
  const bool is_address =
      host.size() > 2 && host.front() == '[' && host.back() == ']' &&
      has_only(std::string_view(host).substr(1, host.size() - 2), kAddressChars);
  require(is_address || (!host.empty() && has_only(host, kHostChars)),
          "a host name, an IPv4 address, or an IPv6 address in brackets");
}

// Returns false if a receiver could resolve the path to another folder.
bool is_plain_path(std::string_view path) {
  for (size_t begin = 0; begin <= path.size();) {
    const size_t end = std::min(path.find('/', begin), path.size());
    std::string_view segment = path.substr(begin, end - begin);
    segment = segment.substr(0, segment.find(';'));  // some servers remove path parameters first
    if (segment == "." || segment == "..") return false;
    begin = end + 1;
  }
  return true;
}

void check_url_path(std::string_view path) {
  const auto decoded = percent_decoded(path);
  require(decoded.has_value(), "two hexadecimal digits after each percent sign of the path");
  require(std::count(path.begin(), path.end(), '/') ==
                  std::count(decoded->begin(), decoded->end(), '/') &&
              decoded->find('\\') == std::string::npos,
          "a path without backslashes and encoded slashes");
  require(is_plain_path(*decoded), "a path without the segments '.' and '..'");
  // Some receivers decode a path twice.
  require(decoded->find('%') == std::string::npos, "a path without encoded percent signs");
  require(std::ranges::none_of(
              *decoded, [](char c) { return static_cast<unsigned char>(c) < ' ' || c == 127; }),
          "a path without encoded control characters");
}

}  // namespace

std::string HttpUrl::origin() const { return scheme + "://" + host + ":" + std::to_string(port); }

HttpUrl parse_http_url(std::string_view text) {
  require(text.size() <= kMaxChars, "at most " + std::to_string(kMaxChars) + " characters");
  HttpUrl url;
  const size_t colon = text.find("://");
  if (colon != std::string_view::npos) url.scheme = lower_case(text.substr(0, colon));
  require(url.scheme == "http" || url.scheme == "https", "http:// or https:// at the beginning");
  text.remove_prefix(colon + 3);
  const size_t slash = std::min(text.find_first_of("/?#"), text.size());
  std::string_view authority = text.substr(0, slash);
  require(authority.find('@') == std::string_view::npos, "no user name and no password");
  url.port = take_port(authority, url.scheme == "https" ? 443 : 80);
  url.host = lower_case(authority);
  check_url_host(url.host);
  url.target = text.substr(slash);
  if (!url.target.starts_with('/')) url.target.insert(0, "/");
  require(has_only(url.target, kTargetChars),
          "no fragment, and only the characters of RFC 3986 in the path and the query");
  check_url_path(url.path());
  return url;
}

bool is_below(const HttpUrl& url, const HttpUrl& prefix) {
  if (url.scheme != prefix.scheme || url.host != prefix.host || url.port != prefix.port)
    return false;
  const std::string path = url.path(), folder = prefix.path();
  return path == folder || path.starts_with(folder.ends_with('/') ? folder : folder + '/');
}

}  // namespace voxdag::server
