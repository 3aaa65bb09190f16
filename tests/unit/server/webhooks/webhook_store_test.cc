#include "server/webhooks/webhook_store.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "server/webhooks/webhook_message.h"
#include "tests/support/temporary_folder.h"

namespace voxdag::server {
namespace {

// The second test case of RFC 4231.
TEST(WebhookMessage, HasTheSignatureOfTheStandard) {
  EXPECT_EQ(webhook_signature("Jefe", "what do ya want for nothing?"),
            "sha256=5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
}

TEST(WebhookMessage, DescribesTheEndOfTheJob) {
  Job job;
  job.id = "6b1f0c7a93d2e845";
  job.name = "a\x1b[2J";
  job.request = R"({"scene":["a.glb"],"labels":["x"],"webhook":"http://h/a"})";
  job.result = R"({"sha256":"ab","bytes":12,"levels":[]})";
  EXPECT_EQ(webhook_url_of(job), "http://h/a");
  EXPECT_EQ(nlohmann::json::parse(webhook_body("d1", job, {7, 2.5, JobState::kSucceeded, 1, ""})),
            nlohmann::json::parse(R"({"delivery":"d1","id":"6b1f0c7a93d2e845","name":"a?[2J",
                "labels":["x"],"state":"succeeded","at":"1970-01-01T00:00:02.500Z","error":null,
                "result":{"sha256":"ab","bytes":12}})"));
  const auto failed =
      nlohmann::json::parse(webhook_body("d1", job, {7, 2.5, JobState::kFailed, 1, "io"}));
  EXPECT_EQ(failed["error"], "io");
  EXPECT_EQ(failed["result"], nullptr) << "a result of an earlier run";
  job.request = "damaged \"webhook\"";
  EXPECT_EQ(webhook_url_of(job), "");
}

class Deliveries : public testing::Test {
 protected:
  Delivery delivery(const std::string& id, int64_t event, double next_s,
                    const std::string& origin = "http://h:80") {
    Delivery delivery;
    delivery.id = id;
    delivery.event = event;
    delivery.job = "job of " + origin;
    delivery.url = origin + "/x";
    delivery.origin = origin;
    delivery.next_s = next_s;
    return delivery;
  }
  std::string next(double now_s, const std::set<std::string>& except = {},
                   const std::set<std::string>& except_origins = {}) {
    const auto found = store_.next(now_s, 1000, except, except_origins);
    return found ? found->id : "";
  }

  TemporaryFolder folder_;
  WebhookStore store_{folder_.file("webhooks.db"), 5};
};

TEST_F(Deliveries, AreDueInOrder) {
  store_.add(delivery("late", 6, 30));
  store_.add(delivery("early", 7, 20));
  store_.add(delivery("other", 8, 25, "http://i:80"));
  EXPECT_EQ(next(19), "");
  EXPECT_EQ(store_.next_time_s(19), 20);
  EXPECT_EQ(next(40), "early");
  EXPECT_EQ(next(40, {"early"}), "other");
  EXPECT_EQ(next(40, {"early"}, {"http://i:80"}), "late");
  EXPECT_EQ(next(40, {"early", "late"}, {"http://i:80"}), "");
  EXPECT_EQ(next(-2000), "early") << "the clock was set back";
  EXPECT_EQ(store_.pending_count(), 3u);
  Delivery done = delivery("early", 7, 20);
  done.state = DeliveryState::kDelivered;
  store_.update(done);
  EXPECT_EQ(next(40), "other");
  EXPECT_TRUE(std::isinf(store_.next_time_s(30)));
}

// A new database begins at the event that its constructor gets. An existing database ignores this
// event, and continues at the last event that it has stored.
TEST_F(Deliveries, AreStoredWithTheirEvents) {
  EXPECT_EQ(store_.last_event(), 5);
  store_.add(delivery("a", 9, 0));
  EXPECT_EQ(store_.last_event(), 9);
  store_.skip_to(12);
  WebhookStore again(folder_.file("webhooks.db"), 100);
  EXPECT_EQ(again.last_event(), 12);
  EXPECT_EQ(again.next(1, 1000, {}, {})->id, "a");
}

TEST_F(Deliveries, OfAJobAreLimited) {
  for (int i = 0; i < 20; ++i) store_.add(delivery("d" + std::to_string(i), 6 + i, i));
  EXPECT_EQ(store_.pending_count(), 8u);
  EXPECT_EQ(store_.newest("job of http://h:80")->id, "d19");
  EXPECT_EQ(store_.jobs().size(), 1u);
  store_.remove_job("job of http://h:80");
  EXPECT_EQ(store_.pending_count(), 0u);
  EXPECT_FALSE(store_.newest("job of http://h:80").has_value());
}

}  // namespace
}  // namespace voxdag::server
