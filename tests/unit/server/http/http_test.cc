#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "core/base/clock.h"
#include "server/http/connection/connection_table.h"
#include "server/http/message/byte_range.h"
#include "server/http/message/headers.h"
#include "server/http/message/problem.h"
#include "server/http/message/target.h"

namespace voxdag::server {
namespace {

using Kind = RangeAnswer::Kind;
using Ranges = std::vector<ByteRange>;

// Ranges are clipped to the end of the file.
TEST(ByteRanges, AreClippedToTheFile) {
  EXPECT_EQ(parse_ranges("bytes=0-9", 100).ranges, (Ranges{{0, 10}}));
  EXPECT_EQ(parse_ranges("bytes=90-", 100).ranges, (Ranges{{90, 100}}));
  EXPECT_EQ(parse_ranges("bytes=-5", 100).ranges, (Ranges{{95, 100}}));
  EXPECT_EQ(parse_ranges("bytes=-500", 100).ranges, (Ranges{{0, 100}}));
  EXPECT_EQ(parse_ranges("bytes=99-200", 100).ranges, (Ranges{{99, 100}}));
  EXPECT_EQ(parse_ranges("Bytes= 0-0 , 5-9 ,,", 100).ranges, (Ranges{{0, 1}, {5, 10}}));
  EXPECT_EQ(parse_ranges("bytes=0-0, 200-300", 100).ranges, (Ranges{{0, 1}}));
}

TEST(ByteRanges, OutsideTheFileAreUnsatisfiable) {
  for (const char* header : {"bytes=100-", "bytes=100-200", "bytes=-0", "bytes=200-300,400-",
                             "bytes=18446744073709551615-", "bytes=99999999999999999999999-"}) {
    SCOPED_TRACE(header);
    EXPECT_EQ(parse_ranges(header, 100).kind, Kind::kUnsatisfiable);
  }
}

// A malformed or excessive Range header is ignored, so the answer is the complete file.
TEST(ByteRanges, MalformedOrExcessiveHeadersAreIgnored) {
  for (const char* header :
       {"", "bytes", "bytes=", "bytes=-", "bytes=5-4", "bytes=a-b", "bytes=1", "items=0-1",
        "bytes=0-1-2", "bytes=+0-1", "bytes=0-99,0-99", "bytes= - ",
        "bytes=0-0,0-0,0-0,0-0,0-0,0-0,0-0,0-0,0-0,0-0,0-0,0-0,0-0,0-0,0-0,0-0,0-0"}) {
    SCOPED_TRACE(header);
    EXPECT_EQ(parse_ranges(header, 100).kind, Kind::kWhole);
  }
}

TEST(ContentRange, IsParsed) {
  ByteRange range;
  uint64_t total = 0;
  ASSERT_TRUE(parse_content_range("bytes 5-9/20", range, total));
  EXPECT_EQ(range, (ByteRange{5, 10}));
  EXPECT_EQ(total, 20u);
  for (const char* header :
       {"", "bytes 5-9", "bytes 5-9/*", "bytes */20", "bytes 9-5/20", "bytes 5-20/20", "5-9/20",
        "bytes 5/20-9", "bytes -9/20", "bytes 0-18446744073709551615/18446744073709551615"}) {
    SCOPED_TRACE(header);
    EXPECT_FALSE(parse_content_range(header, range, total));
  }
}

TEST(Target, IsParsed) {
  const Target target = parse_target("/api/v1/jobs/a%20b?limit=5&state=a%2Cb+c&empty");
  EXPECT_EQ(target.segments, (std::vector<std::string>{"api", "v1", "jobs", "a b"}));
  EXPECT_EQ(target.query.at("limit"), "5");
  EXPECT_EQ(target.query.at("state"), "a,b c");
  EXPECT_EQ(target.query.at("empty"), "");
  EXPECT_TRUE(parse_target("/").segments.empty());
  EXPECT_EQ(parse_target("http://host:80/x").segments, (std::vector<std::string>{"x"}));
}

// The parser of targets does not resolve dots or encoded slashes: they are parts of the names of
// segments.
TEST(Target, DoesNotResolveDots) {
  EXPECT_EQ(parse_target("/a/../b").segments, (std::vector<std::string>{"a", "..", "b"}));
  EXPECT_EQ(parse_target("/a/..%2f..%2fetc").segments,
            (std::vector<std::string>{"a", "../../etc"}));
  EXPECT_EQ(parse_target("//a").segments, (std::vector<std::string>{"", "a"}));
}

TEST(Target, RejectsMalformedTargets) {
  for (const char* text : {"", "x", "*", "/%", "/%2", "/%zz", "/%00", "/a%0d%0ab", "/?a=1&a=2"}) {
    SCOPED_TRACE(text);
    EXPECT_THROW(parse_target(text), Problem);
  }
}

TEST(Headers, CompareCaseInsensitively) {
  const HeaderMap headers = {{"Content-Type", "a"}};
  EXPECT_EQ(header_value(headers, "content-TYPE"), "a");
  EXPECT_EQ(header_value(headers, "content"), "");
  EXPECT_EQ(trimmed(" \t a b \t"), "a b");
  EXPECT_EQ(trimmed(" "), "");
}

// If the table is full, a new connection replaces the connection that has waited longest for a
// request. Connections whose requests are being answered are kept.
TEST(ConnectionTable, EvictsTheLongestWaiting) {
  HttpLimits limits;
  limits.max_connections = 4;
  limits.max_per_client = 2;
  ConnectionTable table(limits);
  ConnectionTable::Place first, second, third, more;
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(table.admit(-1, "10.0.0.9", more));
    table.set_working(more);
  }
  ASSERT_TRUE(table.admit(-1, "10.0.0.1", first));
  ASSERT_TRUE(table.admit(-1, "10.0.0.1", second));
  EXPECT_FALSE(table.admit(-1, "10.0.0.1", third)) << "the limit per client";
  table.set_working(first);
  ASSERT_TRUE(table.admit(-1, "10.0.0.2", third)) << "the second one waits and is evicted";
  table.remove(second);
  table.set_working(third);
  EXPECT_FALSE(table.admit(-1, "10.0.0.3", second)) << "all have requests";
  table.remove(first);
  table.remove(third);
  EXPECT_EQ(table.size(), 2u);
}

// If the table is full, a new connection can also replace a connection in the middle of a body or
// an answer, but only after this connection has waited for its client for some time.
TEST(SlowConnections, SlowTransfersAreEvicted) {
  HttpLimits limits;
  limits.max_connections = 4;
  ConnectionTable table(limits);
  ConnectionTable::Place slow, fast, other, more;
  ASSERT_TRUE(table.admit(-1, "10.0.0.1", more));
  table.set_working(more);
  ASSERT_TRUE(table.admit(-1, "10.0.0.1", more));
  table.set_working(more);
  ASSERT_TRUE(table.admit(-1, "10.0.0.1", slow));
  ASSERT_TRUE(table.admit(-1, "10.0.0.2", fast));
  table.set_waiting(slow, wall_seconds() - 2, ConnectionTable::Waiting::kInExchange);
  table.set_waiting(fast, wall_seconds(), ConnectionTable::Waiting::kInExchange);
  EXPECT_TRUE(table.admit(-1, "10.0.0.3", other));
  table.remove(slow);
  table.set_working(other);
  EXPECT_FALSE(table.admit(-1, "10.0.0.3", slow)) << "only the fast one waits";
}

// A connection that waits for the rest of a short body can be replaced immediately.
TEST(SlowConnections, ShortBodiesAreEvictedWithoutDelay) {
  HttpLimits limits;
  limits.max_connections = 1;
  ConnectionTable table(limits);
  ConnectionTable::Place first, second;
  ASSERT_TRUE(table.admit(-1, "10.0.0.1", first));
  table.set_waiting(first, wall_seconds(), ConnectionTable::Waiting::kInExchange);
  EXPECT_FALSE(table.admit(-1, "10.0.0.2", second));
  table.set_waiting(first, wall_seconds(), ConnectionTable::Waiting::kForShortBody);
  EXPECT_TRUE(table.admit(-1, "10.0.0.2", second));
}

// All answers together have a memory limit. If it is reached, a new answer replaces the one that
// has waited longest for its client. Answers whose clients are reading are kept.
TEST(AnswerMemory, TheLongestWaitingAnswerGivesWay) {
  constexpr size_t kMost = ConnectionTable::kMaxAnswerBytes;
  const HttpLimits limits;
  ConnectionTable table(limits);
  ConnectionTable::Place first, second, third;
  for (ConnectionTable::Place* place : {&first, &second, &third}) {
    ASSERT_TRUE(table.admit(-1, "127.0.0.1", *place));
    table.set_working(*place);
  }
  ASSERT_TRUE(table.reserve_answer(first, kMost / 2));
  ASSERT_TRUE(table.reserve_answer(second, kMost / 2));
  EXPECT_FALSE(table.reserve_answer(third, 1)) << "nobody waits";
  table.set_waiting(first, wall_seconds() - 2, ConnectionTable::Waiting::kInExchange);
  table.set_waiting(second, wall_seconds() - 1, ConnectionTable::Waiting::kInExchange);
  std::thread evicted([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    table.remove(first);
  });
  EXPECT_TRUE(table.reserve_answer(third, kMost / 2)) << "the first one is closed";
  evicted.join();
  table.release_answer(third);
  EXPECT_TRUE(table.reserve_answer(third, kMost / 2)) << "the second one is still there";
}

TEST(AnswerMemory, OneClientCannotTakeItAll) {
  constexpr size_t kMost = ConnectionTable::kMaxAnswerBytesPerClient;
  const HttpLimits limits;
  ConnectionTable table(limits);
  ConnectionTable::Place first, second, other;
  ASSERT_TRUE(table.admit(-1, "10.0.0.1", first));
  ASSERT_TRUE(table.admit(-1, "10.0.0.1", second));
  ASSERT_TRUE(table.admit(-1, "10.0.0.2", other));
  for (const ConnectionTable::Place place : {first, second, other}) table.set_working(place);
  ASSERT_TRUE(table.reserve_answer(first, kMost));
  EXPECT_FALSE(table.reserve_answer(second, 1));
  EXPECT_TRUE(table.reserve_answer(other, kMost));
}

// The limit per client does not apply to loopback addresses, because a proxy on this machine
// forwards the requests of all clients.
TEST(AnswerMemory, TheLoopbackMayTakeItAll) {
  constexpr size_t kMost = ConnectionTable::kMaxAnswerBytes;
  const HttpLimits limits;
  for (const char* address : {"127.0.0.1", "::1", "::ffff:127.0.0.1"}) {
    SCOPED_TRACE(address);
    ConnectionTable table(limits);
    ConnectionTable::Place first, second;
    ASSERT_TRUE(table.admit(-1, address, first));
    ASSERT_TRUE(table.admit(-1, address, second));
    table.set_working(first);
    EXPECT_FALSE(table.reserve_answer(first, kMost + 1));
    ASSERT_TRUE(table.reserve_answer(first, kMost)) << "one answer";
    table.release_answer(first);
    ASSERT_TRUE(table.reserve_answer(first, kMost / 2));
    EXPECT_TRUE(table.reserve_answer(second, kMost / 2)) << "two answers";
  }
}

// An evicted connection remains until its thread ends. The number of such connections is limited,
// here to 3.
TEST(SlowConnections, EvictedConnectionsAreBounded) {
  HttpLimits limits;
  limits.max_connections = 8;
  ConnectionTable table(limits);
  ConnectionTable::Place place;
  size_t admitted = 0;
  while (admitted < 100 && table.admit(-1, "10.0.0.1", place)) ++admitted;
  EXPECT_EQ(admitted, 11u);
}

// All addresses of a /64 network are one client, and so are the two notations of an IPv4 address.
TEST(SlowConnections, AnIpv6NetworkIsOneClient) {
  EXPECT_EQ(client_of("10.0.0.1"), "10.0.0.1");
  EXPECT_EQ(client_of("::ffff:10.0.0.1"), "10.0.0.1");
  EXPECT_EQ(client_of("2001:db8:1:2:3:4:5:6"), client_of("2001:db8:1:2:ffff::1"));
  EXPECT_NE(client_of("2001:db8:1:2::1"), client_of("2001:db8:1:3::1"));
  EXPECT_EQ(client_of("fe80::1%eth0"), "fe80::/64");
  HttpLimits limits;
  limits.max_per_client = 2;
  ConnectionTable table(limits);
  ConnectionTable::Place place;
  EXPECT_TRUE(table.admit(-1, "2001:db8::1", place));
  EXPECT_TRUE(table.admit(-1, "2001:db8::2", place));
  EXPECT_FALSE(table.admit(-1, "2001:db8::3", place));
  EXPECT_TRUE(table.admit(-1, "2001:db8:0:1::3", place));
}

}  // namespace
}  // namespace voxdag::server
