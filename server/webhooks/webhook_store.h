// The deliveries of webhooks, stored durably in one SQLite file, DATA/webhooks.db. A delivery is
// stored before its first attempt, in the same transaction as the number of the event that caused
// it. So each end of a job causes exactly one delivery, and a restart loses none. Thread-safe.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/db/sqlite.h"

namespace voxdag::server {

enum class DeliveryState { kPending, kDelivered, kFailed };

inline constexpr const char* kDeliveryStateNames[] = {"pending", "delivered", "failed"};

struct Delivery {
  std::string id;
  int64_t event = 0;  // number of the job event that this delivery reports
  std::string job;
  std::string url;
  std::string origin;  // of the URL
  std::string body;
  DeliveryState state = DeliveryState::kPending;
  unsigned attempts = 0;
  // Unix times in seconds. The next attempt does not start before `next_s`. `ended_s` is 0 while
  // the delivery is pending.
  double created_s = 0, next_s = 0, ended_s = 0;
  int status = 0;     // HTTP status of the last answer; 0 for none
  std::string error;  // reason why the last attempt failed; "" for none
};

class WebhookStore {
 public:
  // Opens the database at `path`, or creates it. A new database begins after the event
  // `last_event`.
  WebhookStore(const std::string& path, int64_t last_event);

  // Returns the number of the last event for which add() or skip_to() was called.
  int64_t last_event();
  // Adds a delivery. Then keeps only the newest deliveries of the same job.
  void add(const Delivery& delivery);
  // Records that the events up to this number need no more deliveries.
  void skip_to(int64_t event);
  // Replaces the delivery with the same id. Does nothing if the delivery was removed.
  void update(const Delivery& delivery);

  // Returns the pending delivery that is due at `now_s` and waits longest, without the deliveries
  // `except` and without deliveries to the origins `except_origins`. A delivery that would have to
  // wait longer than `max_wait_s` is due: such a wait means that the clock was set back.
  std::optional<Delivery> next(double now_s, double max_wait_s, const std::set<std::string>& except,
                               const std::set<std::string>& except_origins);
  // Returns the earliest time after `now_s` at which a pending delivery is due; infinity if there
  // is none.
  double next_time_s(double now_s);
  uint64_t pending_count();
  // Returns the newest delivery of a job.
  std::optional<Delivery> newest(const std::string& job);
  std::set<std::string> jobs();
  void remove_job(const std::string& job);

 private:
  std::mutex mutex_;
  SqlDatabase database_;
};

}  // namespace voxdag::server
