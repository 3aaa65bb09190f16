#include "server/webhooks/webhook_store.h"

#include <limits>

#include "core/db/table_rows.h"
#include "server/disk/store.h"

namespace voxdag::server {
namespace {

// A job has a new delivery each time it ends. It can end again after a client has retried it.
constexpr int64_t kMaxDeliveriesPerJob = 8;

constexpr const char* kWebhookSchema = R"sql(
CREATE TABLE delivery (
  id TEXT PRIMARY KEY,
  event INTEGER NOT NULL UNIQUE,
  job TEXT NOT NULL,
  url TEXT NOT NULL,
  origin TEXT NOT NULL,
  body TEXT NOT NULL,
  state INTEGER NOT NULL CHECK (state BETWEEN 0 AND 2),
  attempts INTEGER NOT NULL,
  created_s REAL NOT NULL, next_s REAL NOT NULL, ended_s REAL NOT NULL,
  status INTEGER NOT NULL,
  error TEXT NOT NULL
);
CREATE INDEX delivery_by_time ON delivery (state, next_s);
CREATE INDEX delivery_by_job ON delivery (job, event);
CREATE TABLE last_event (id INTEGER PRIMARY KEY CHECK (id = 1), number INTEGER NOT NULL);
)sql";

// Application id "vdsw": the webhooks of a service.
const StoreFormat kWebhookFormat = {"the webhooks", "webhooks", 0x76647377, 1, kWebhookSchema};

void put_last_event(SqlDatabase& database, int64_t event) {
  database.prepare("INSERT OR REPLACE INTO last_event VALUES (1, ?)").bind(0, event).run();
}

std::optional<Delivery> read_one(SqlStatement& rows) {
  if (!rows.step()) return {};
  return read_row<Delivery>(rows);
}

// Returns `count` parameters of SQL, separated by commas.
std::string parameters(size_t count) {
  std::string list;
  for (size_t i = 0; i < count; ++i) list += i > 0 ? ", ?" : "?";
  return list;
}

}  // namespace

template <class Row>
void fields(Row& row, Delivery& d) {
  row("id", d.id);
  row("event", d.event);
  row("job", d.job);
  row("url", d.url);
  row("origin", d.origin);
  row("body", d.body);
  row("state", d.state);
  row("attempts", d.attempts);
  row("created_s", d.created_s);
  row("next_s", d.next_s);
  row("ended_s", d.ended_s);
  row("status", d.status);
  row("error", d.error);
}

WebhookStore::WebhookStore(const std::string& path, int64_t last_event)
    : database_(open_store(path, kWebhookFormat, true)) {
  database_.prepare("INSERT OR IGNORE INTO last_event VALUES (1, ?)").bind(0, last_event).run();
}

int64_t WebhookStore::last_event() {
  std::lock_guard lock(mutex_);
  return database_.integer("SELECT number FROM last_event");
}

void WebhookStore::add(const Delivery& delivery) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  put_row(database_, "delivery", delivery);
  database_
      .prepare(
          "DELETE FROM delivery WHERE job = ?1 AND event <= (SELECT event FROM delivery "
          "WHERE job = ?1 ORDER BY event DESC LIMIT 1 OFFSET ?2)")
      .bind(0, delivery.job)
      .bind(1, kMaxDeliveriesPerJob)
      .run();
  put_last_event(database_, delivery.event);
  transaction.commit();
}

void WebhookStore::skip_to(int64_t event) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_, Durable::kLater);
  put_last_event(database_, event);
  transaction.commit();
}

void WebhookStore::update(const Delivery& delivery) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  update_row(database_, "delivery", "event = " + std::to_string(delivery.event), delivery);
  transaction.commit();
}

std::optional<Delivery> WebhookStore::next(double now_s, double max_wait_s,
                                           const std::set<std::string>& except,
                                           const std::set<std::string>& except_origins) {
  std::lock_guard lock(mutex_);
  auto rows = select_rows<Delivery>(
      database_, "delivery",
      "WHERE state = 0 AND (next_s <= ? OR next_s > ?) AND id NOT IN (" +
          parameters(except.size()) + ") AND origin NOT IN (" + parameters(except_origins.size()) +
          ") ORDER BY next_s, event LIMIT 1");
  rows.bind(0, now_s).bind(1, now_s + max_wait_s);
  int parameter = 2;
  for (const auto* list : {&except, &except_origins})
    for (const std::string& text : *list) rows.bind(parameter++, text);
  return read_one(rows);
}

double WebhookStore::next_time_s(double now_s) {
  std::lock_guard lock(mutex_);
  auto rows = database_.prepare(
      "SELECT next_s FROM delivery WHERE state = 0 AND next_s > ? ORDER BY next_s LIMIT 1");
  return rows.bind(0, now_s).step() ? rows.real(0) : std::numeric_limits<double>::infinity();
}

uint64_t WebhookStore::pending_count() {
  std::lock_guard lock(mutex_);
  return static_cast<uint64_t>(database_.integer("SELECT count(*) FROM delivery WHERE state = 0"));
}

std::optional<Delivery> WebhookStore::newest(const std::string& job) {
  std::lock_guard lock(mutex_);
  auto rows =
      select_rows<Delivery>(database_, "delivery", "WHERE job = ? ORDER BY event DESC LIMIT 1");
  rows.bind(0, job);
  return read_one(rows);
}

std::set<std::string> WebhookStore::jobs() {
  std::lock_guard lock(mutex_);
  auto rows = database_.prepare("SELECT DISTINCT job FROM delivery");
  std::set<std::string> jobs;
  while (rows.step()) jobs.insert(rows.text(0));
  return jobs;
}

void WebhookStore::remove_job(const std::string& job) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  database_.prepare("DELETE FROM delivery WHERE job = ?").bind(0, job).run();
  transaction.commit();
}

}  // namespace voxdag::server
