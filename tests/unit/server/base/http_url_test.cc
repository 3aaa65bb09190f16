#include "server/base/http_url.h"

#include <gtest/gtest.h>

#include "core/base/error.h"

namespace voxdag::server {
namespace {

TEST(HttpUrl, HasItsParts) {
  const HttpUrl url = parse_http_url("HTTPS://Hooks.Example.org/a/b?x=1");
  EXPECT_EQ(url.scheme, "https");
  EXPECT_EQ(url.host, "hooks.example.org");
  EXPECT_EQ(url.port, 443);
  EXPECT_EQ(url.target, "/a/b?x=1");
  EXPECT_EQ(url.path(), "/a/b");
  EXPECT_EQ(url.origin(), "https://hooks.example.org:443");
  EXPECT_EQ(parse_http_url("http://h/a%20b;c=1/..d").target, "/a%20b;c=1/..d");
  EXPECT_EQ(parse_http_url("http://h").target, "/");
  EXPECT_EQ(parse_http_url("http://h?q").target, "/?q");
  EXPECT_EQ(parse_http_url("http://[::1]:8080/x").origin(), "http://[::1]:8080");
  EXPECT_EQ(parse_http_url("http://[::1]").port, 80);
}

TEST(HttpUrl, IsRefusedWithAReason) {
  const std::pair<std::string, const char*> urls[] = {
      {"", "http://"},
      {"ftp://h/", "http://"},
      {"//h/", "http://"},
      {"http://", "host"},
      {"http:///x", "host"},
      {"http://a b/", "host"},
      {"http://h\\.evil/", "host"},
      {"http://h%2e/", "host"},
      {"http://user@h/", "user name"},
      {"http://user:password@h/", "user name"},
      {"http://h:0/", "port"},
      {"http://h:65536/", "port"},
      {"http://h:/", "port"},
      {"http://h:80x/", "port"},
      {"http://h/#x", "fragment"},
      {"http://h/\r\nX: y", "characters"},
      {"http://h/\xc3\xa9", "characters"},
      {"http://h/%zz", "hexadecimal"},
      {"http://h/a/../b", "segments"},
      {"http://h/a/%2E%2e", "segments"},
      {"http://h/./b", "segments"},
      {"http://h/a/..;/b", "segments"},
      {"http://h/a/%2e%2E;x/b", "segments"},
      {"http://h/a/%252e%252e/b", "percent signs"},
      {"http://h/a%00", "control characters"},
      {"http://h/a%0d%0aX:y", "control characters"},
      {"http://h/a%2f..%2fb", "slashes"},
      {"http://h/a%5cb", "slashes"},
      {"http://h/" + std::string(1024, 'a'), "1024"},
  };
  for (const auto& [url, part] : urls) {
    SCOPED_TRACE(url);
    try {
      parse_http_url(url);
      ADD_FAILURE() << "was accepted";
    } catch (const Error& error) {
      EXPECT_NE(error.message().find(part), std::string::npos) << error.message();
    }
  }
}

TEST(HttpUrl, IsBelowAPrefix) {
  const auto is_allowed = [](const char* url, const char* prefix) {
    return is_below(parse_http_url(url), parse_http_url(prefix));
  };
  EXPECT_TRUE(is_allowed("http://h/any", "http://h"));
  EXPECT_TRUE(is_allowed("http://H:80/any", "http://h/"));
  EXPECT_TRUE(is_allowed("http://h/a", "http://h/a"));
  EXPECT_TRUE(is_allowed("http://h/a?q=/../", "http://h/a"));
  EXPECT_TRUE(is_allowed("http://h/a/b", "http://h/a"));
  EXPECT_TRUE(is_allowed("http://h/a/b", "http://h/a/"));
  EXPECT_FALSE(is_allowed("http://h/ab", "http://h/a"));
  EXPECT_FALSE(is_allowed("http://h/a", "http://h/a/"));
  EXPECT_FALSE(is_allowed("http://h/A/b", "http://h/a/"));
  EXPECT_FALSE(is_allowed("https://h/a", "http://h/a"));
  EXPECT_FALSE(is_allowed("http://h:81/a", "http://h/a"));
  EXPECT_FALSE(is_allowed("http://h.evil/a", "http://h/a"));
}

}  // namespace
}  // namespace voxdag::server
