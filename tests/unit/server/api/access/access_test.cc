#include <gtest/gtest.h>

#include <filesystem>

#include "core/format/checksum.h"
#include "server/api/access/access_control.h"
#include "server/api/access/concurrency_limiter.h"
#include "server/api/access/rate_limiter.h"
#include "server/api/access/tokens.h"
#include "server/api/answers/public_problem.h"
#include "server/base/request_error.h"
#include "server/config/config.h"
#include "server/http/message/digest_field.h"
#include "server/jobs/protocol/job_request.h"
#include "tests/support/temporary_folder.h"

namespace voxdag::server {
namespace {

int status_of(const std::function<void()>& act) {
  try {
    act();
    return 0;
  } catch (const Problem& problem) {
    return problem.status;
  }
}

TEST(TokenFile, AcceptsTheListedTokens) {
  const TemporaryFolder folder;
  const NewToken reader = make_token("read", "r"), admin = make_token("admin", "anna@x");
  write_file_atomically(system_files(), folder.file("t"),
                        "# people\n\n" + reader.line + "\n  " + admin.line + "\n");
  const Tokens tokens = Tokens::read(system_files(), folder.file("t"));
  ASSERT_TRUE(tokens.find(admin.token));
  EXPECT_EQ(tokens.find(admin.token)->role, Role::kAdmin);
  EXPECT_EQ(tokens.find(admin.token)->name, "anna@x");
  EXPECT_EQ(tokens.find(reader.token)->role, Role::kRead);
  EXPECT_FALSE(tokens.find(""));
  EXPECT_FALSE(tokens.find(admin.token + "x"));
  EXPECT_FALSE(tokens.find(admin.line.substr(admin.line.rfind(' ') + 1))) << "the hash is no token";
  EXPECT_NE(reader.token, admin.token);
}

TEST(TokenFile, RejectsMalformedLines) {
  const TemporaryFolder folder;
  for (const std::string& text : std::vector<std::string>{
           "", "# none\n", "root a " + sha256_hex("x"), "read a", "read a abc",
           "read a " + sha256_hex("x") + " more", "read a/b " + sha256_hex("x")}) {
    SCOPED_TRACE(text);
    write_file_atomically(system_files(), folder.file("t"), text);
    EXPECT_THROW(Tokens::read(system_files(), folder.file("t")), Error);
  }
}

class AccessControlTest : public testing::Test {
 protected:
  Request request(const std::string& method, HeaderMap headers,
                  const std::string& peer = "127.0.0.1") {
    Request r;
    r.method = method;
    r.headers = std::move(headers);
    r.peer = peer;
    r.target = parse_target("/api/v1/jobs");
    return r;
  }
  int status(AccessControl& access, Request r, Role role) {
    return status_of([&] { access.admit(r, role); });
  }
  ServerConfig config_;
  TemporaryFolder folder_;
};

// Without tokens, the service rejects requests from pages of other sites, even if the host name of
// such a site resolves to this machine.
TEST_F(AccessControlTest, RejectsOtherSitesWithoutTokens) {
  AccessControl access(config_, system_files());
  EXPECT_EQ(status(access, request("GET", {{"Host", "localhost:8080"}}), Role::kAdmin), 0);
  EXPECT_EQ(status(access, request("GET", {{"Host", "[::1]:8080"}}), Role::kRead), 0);
  EXPECT_EQ(status(access, request("GET", {{"Host", "evil.example"}}), Role::kRead), 403);
  const auto post = [&](const char* origin) {
    return status(access, request("POST", {{"Host", "127.0.0.1:8080"}, {"Origin", origin}}),
                  Role::kSubmit);
  };
  EXPECT_EQ(post("http://127.0.0.1:8080"), 0);
  EXPECT_EQ(post("http://evil.example"), 403);
  EXPECT_EQ(post("http://127.0.0.1:9999"), 403);
  EXPECT_EQ(post("null"), 403);
  const auto read = [&](const char* site) {
    return status(access, request("GET", {{"Sec-Fetch-Site", site}}), Role::kRead);
  };
  EXPECT_EQ(read("cross-site"), 403);
  EXPECT_EQ(read("same-origin"), 0);
}

TEST_F(AccessControlTest, RequiresATokenWithTheRole) {
  const NewToken reader = make_token("read", "r"), admin = make_token("admin", "a");
  write_file_atomically(system_files(), folder_.file("t"), reader.line + "\n" + admin.line);
  config_.token_file = folder_.file("t");
  AccessControl access(config_, system_files());
  const auto with = [&](const std::string& header, Role role) {
    return status(access, request("GET", {{"Authorization", header}}), role);
  };
  EXPECT_EQ(status(access, request("GET", {}), Role::kNone), 0);
  EXPECT_EQ(status(access, request("GET", {}), Role::kRead), 401);
  EXPECT_EQ(with("Bearer " + reader.token, Role::kRead), 0);
  EXPECT_EQ(with("bearer " + admin.token, Role::kSubmit), 0);
  EXPECT_EQ(with("Bearer " + reader.token, Role::kSubmit), 403);
  EXPECT_EQ(with("Basic " + reader.token, Role::kRead), 401);
  EXPECT_EQ(with("Bearer", Role::kRead), 401);
  for (int i = 0; i < 100; ++i) with("Bearer wrong", Role::kRead);
  EXPECT_EQ(with("Bearer wrong", Role::kRead), 429);
  EXPECT_EQ(with("Bearer " + reader.token, Role::kRead), 0)
      << "a valid token is accepted while another client guesses";
}

TEST(RateLimiterTest, RefillsWithTime) {
  RateLimiter limiter(2);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(limiter.take("a", 0)) << i;
  EXPECT_FALSE(limiter.take("a", 0));
  EXPECT_TRUE(limiter.take("b", 0));
  EXPECT_TRUE(limiter.take("a", 0.5));
  EXPECT_FALSE(limiter.take("a", 0.5));
  RateLimiter unlimited(0);
  for (int i = 0; i < 1000; ++i) EXPECT_TRUE(unlimited.take("a", 0));
}

TEST(ConcurrencyLimiterTest, ReleasesPermits) {
  ConcurrencyLimiter limiter(1, 1);
  auto first = limiter.acquire("a");
  EXPECT_TRUE(first);
  EXPECT_FALSE(limiter.acquire("b"));
  first.reset();
  EXPECT_EQ(limiter.in_use(), 0u);
  EXPECT_TRUE(limiter.acquire("b"));
}

// Each client has its own limit of permits, so one client cannot take all of them.
TEST(ConcurrencyLimits, EachClientHasALimitOfItsOwn) {
  ConcurrencyLimiter limiter(3, 2);
  const auto first = limiter.acquire("a");
  auto second = limiter.acquire("a");
  EXPECT_TRUE(first && second);
  EXPECT_FALSE(limiter.acquire("a"));
  EXPECT_TRUE(limiter.acquire("b"));
  second.reset();
  EXPECT_TRUE(limiter.acquire("a"));
}

// A client is a token or an address. All addresses of a /64 network are one client.
TEST_F(AccessControlTest, ClientsAreTokensOrNetworks) {
  const NewToken reader = make_token("read", "r");
  write_file_atomically(system_files(), folder_.file("t"), reader.line);
  config_.token_file = folder_.file("t");
  config_.transfers.max_requests_per_s = 1;
  AccessControl access(config_, system_files());
  const HeaderMap token = {{"Authorization", "Bearer " + reader.token}};
  Request first = request("GET", token);
  EXPECT_EQ(access.admit(first, Role::kRead).client, "token r");
  EXPECT_EQ(status(access, request("GET", token, "2001:db8::1"), Role::kRead), 0);
  EXPECT_EQ(status(access, request("GET", token, "2001:db8::2"), Role::kRead), 0);
  EXPECT_EQ(status(access, request("GET", token, "2001:db8::3"), Role::kRead), 429);
}

TEST(DigestField, IsParsedAndFormatted) {
  const std::string sum = sha256_hex("hello");
  EXPECT_EQ(digest_field(sum), "sha-256=:LPJNul+wow4m6DsqxbninhsWHlwfp0JecwQzYpOLmCQ=:");
  EXPECT_EQ(parse_digest_field("md5=:abc=:, " + digest_field(sum)), sum);
  for (const char* field :
       {"", "md5=:abc=:", "sha-256=:abc:", "sha-256=:LPJNul+wow4m6DsqxbninhsWHlwfp0JecwQzYpOLmCQ=",
        "sha-256=:LPJNul+wow4m6DsqxbninhsWHlwfp0JecwQzYpOL!CQ=:"}) {
    SCOPED_TRACE(field);
    EXPECT_THROW(parse_digest_field(field), RequestError);
  }
}

// The examples in configs/ are valid.
TEST(Configs, ExamplesAreValid) {
  const std::string folder = std::string(VOXDAG_SOURCE_DIR) + "/configs";
  ServerConfig config;
  read_config(system_files(), folder + "/server.json", config);
  check_config(config);
  int jobs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder + "/jobs")) {
    SCOPED_TRACE(entry.path());
    parse_job_request(read_small_file(system_files(), entry.path(), 1 << 16));
    ++jobs;
  }
  EXPECT_GE(jobs, 2);
}

TEST(Configs, ErrorsNameTheMember) {
  const TemporaryFolder folder;
  const std::pair<const char*, const char*> texts[] = {
      {"{", "JSON"},
      {"{\"prot\": 1}", "'prot'"},
      {"{\"port\": \"x\"}", "'port'"},
      {"{\"port\": 1e99}", "'port'"},
      {"{\"jobs\": {\"memory\": \"many\"}}", "memory"},
      {"{\"jobs\": {\"max_concurrent\": -1}}", "'max_concurrent'"},
      {"{\"tls\": []}", "'tls'"},
      {"{\"jobs\": {\"threads\": 1, \"threads\": 2}}", "'threads'"},
      {"{\"cluster\": {\"nodes\": 4}}", "'nodes'"},
      {"{\"scene_roots\": \"/x\"}", "'scene_roots'"}};
  for (const auto& [text, part] : texts) {
    SCOPED_TRACE(text);
    write_file_atomically(system_files(), folder.file("c"), text);
    ServerConfig config;
    try {
      read_config(system_files(), folder.file("c"), config);
      ADD_FAILURE() << "was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
      EXPECT_NE(error.message().find(part), std::string::npos) << error.message();
    }
  }
}

// Each setting out of range is refused before the service starts, and the message names it.
TEST(Configs, RangesAreChecked) {
  const TemporaryFolder folder;
  const auto refusal = [&](const std::string& member, const std::string& value) {
    const auto [object, name] =
        std::pair(member.substr(0, member.find('.')), member.substr(member.find('.') + 1));
    const std::string text = object == member
                                 ? "{\"" + member + "\": " + value + "}"
                                 : "{\"" + object + "\": {\"" + name + "\": " + value + "}}";
    write_file_atomically(system_files(), folder.file("c"), text);
    ServerConfig config;
    config.data_folder = "/tmp/x";
    try {
      read_config(system_files(), folder.file("c"), config);
      check_config(config);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
      return error.message();
    }
    return std::string();
  };
  const std::pair<const char*, const char*> refused[] = {{"jobs.threads", "5000"},
                                                         {"jobs.nice", "99"},
                                                         {"jobs.nice", "-21"},
                                                         {"jobs.memory", "\"100TiB\""},
                                                         {"jobs.max_queued", "0"},
                                                         {"jobs.max_attempts", "0"},
                                                         {"jobs.plan_timeout_s", "0"},
                                                         {"exports.memory", "\"100TiB\""},
                                                         {"transfers.max_body_size", "0"},
                                                         {"transfers.max_concurrent", "0"},
                                                         {"transfers.max_scene_size", "0"},
                                                         {"connections.max_header_size", "0"},
                                                         {"connections.max_connections", "7"},
                                                         {"connections.idle_timeout_s", "0"},
                                                         {"hosts", "[\"\"]"},
                                                         {"hosts", "[\"a:80\"]"}};
  for (const auto& [member, value] : refused) {
    const std::string message = refusal(member, value);
    EXPECT_TRUE(message.starts_with(member)) << member << " " << value << ": " << message;
    EXPECT_NE(message.find("expected"), std::string::npos) << message;
  }
  const std::pair<const char*, const char*> accepted[] = {
      {"jobs.threads", "1024"},
      {"jobs.nice", "19"},
      {"connections.max_header_size", "1024"},
      {"jobs.max_queued", "1"},
      {"hosts", "[\"a.example\", \"[2001:db8::1]\"]"}};
  for (const auto& [member, value] : accepted) EXPECT_EQ(refusal(member, value), "") << member;
}

// A configuration that listens on the network without tokens is rejected.
TEST(Configs, RejectTheNetworkWithoutTokens) {
  ServerConfig config;
  config.data_folder = "/tmp/x";
  EXPECT_NO_THROW(check_config(config));
  config.http.address = "0.0.0.0";
  try {
    check_config(config);
    ADD_FAILURE() << "was accepted";
  } catch (const Error& error) {
    EXPECT_NE(error.message().find("--tokens"), std::string::npos) << "says how";
  }
  config.token_file = "/tmp/t";
  EXPECT_NO_THROW(check_config(config));
  config.http.certificate_file = "/tmp/c";
  EXPECT_THROW(check_config(config), Error);
}

}  // namespace
}  // namespace voxdag::server
