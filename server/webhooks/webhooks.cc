#include "server/webhooks/webhooks.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "client/http_client.h"
#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/fields/json_text.h"
#include "core/io/random_id.h"
#include "server/base/printable_json.h"
#include "server/base/request_error.h"
#include "server/base/time_text.h"
#include "server/webhooks/certificates.h"
#include "server/webhooks/webhook_message.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxActive = 8;           // concurrent attempts, each with a thread
constexpr size_t kMaxActivePerOrigin = 2;  // so that slow receivers do not use all slots
constexpr uint64_t kMaxPending = 10000;
constexpr size_t kEndsPerRead = 100;
constexpr double kMaxConnectS = 3;
constexpr double kMaxWebhookSleepS = 1;
constexpr double kStopIntervalS = 0.05;  // between checks of the attempts in progress
// The HTTP library has no limit for the lines of an answer. With this limit, an attempt holds at
// most this many bytes of its answer, plus the bytes that arrive within kStopIntervalS.
constexpr uint64_t kMaxAnswerBytes = 256 << 10;
constexpr double kMaxLookIntervalS = 60;  // because the clock can be set back
constexpr double kForgetIntervalS = 600;
constexpr size_t kMaxErrorBytes = 200;
constexpr uint64_t kMaxSecretBytes = 1024;
constexpr size_t kMinSecretChars = 16;

// Reads the secret, which is the first line of a file.
std::string read_secret(FileSystem& files, const std::string& path) {
  const std::string text = read_small_file(files, path, kMaxSecretBytes);
  const std::string secret = text.substr(0, text.find_first_of("\r\n"));
  if (secret.size() < kMinSecretChars || !is_printable(secret))
    throw Error(ErrorCode::kInvalidInput,
                path + ": expected a secret of at least " + std::to_string(kMinSecretChars) +
                    " printable characters on the first line (webhooks.secret_file)");
  return secret;
}

RequestError refused(const std::string& url, const std::string& expected) {
  return {RequestError::Kind::kInvalid, "'webhook' is '" + printable_line(url) + "': " + expected};
}

}  // namespace

// One attempt of a delivery. The attempt's thread sets the members after `ended`, and sets `ended`
// last.
struct Webhooks::Attempt {
  Delivery delivery;
  double deadline_s = 0;  // in wall_seconds()
  std::unique_ptr<client::HttpClient> http;
  std::thread thread;
  std::atomic<bool> ended{false};
  double end_s = 0;          // in wall_seconds()
  bool is_too_long = false;  // the answer has more than kMaxAnswerBytes; not set by the thread
  int status = 0;
  std::string error;
};

Webhooks::Webhooks(const ServerConfig& config, FileSystem& files, JobQueue& queue, Log log)
    : options_(config.webhooks),
      queue_(queue),
      log_(log),
      steps_(log, config.before_step),
      ended_jobs_(config.data_folder + "/queue.db"),
      store_(config.data_folder + "/webhooks.db", ended_jobs_.last_number()) {
  // OpenSSL's next write to a connection that stop() or a receiver has closed raises SIGPIPE. The
  // signal would end the process.
  std::signal(SIGPIPE, SIG_IGN);
  for (const std::string& prefix : options_.allow) {
    allowed_.push_back(parse_http_url(prefix));
    if (allowed_.back().scheme == "https" && !client::supports_https())
      throw Error(ErrorCode::kInvalidInput,
                  "webhooks.allow: '" + prefix +
                      "': expected http://, because the HTTP library of this build (cpp-httplib) "
                      "has no TLS");
  }
  if (!options_.ca_file.empty()) check_certificates(files, options_.ca_file);
  if (!options_.secret_file.empty()) secret_ = read_secret(files, options_.secret_file);
  // If a backup of the queue was restored, its events have smaller numbers than the last one.
  last_event_ = std::min(store_.last_event(), ended_jobs_.last_number());
  thread_ = std::thread([this] { run(); });
}

Webhooks::~Webhooks() { stop(); }

void Webhooks::check(const std::string& url) const {
  if (allowed_.empty())
    throw refused(url, "expected no webhook, because this service allows none (webhooks.allow)");
  HttpUrl parsed;
  try {
    parsed = parse_http_url(url);
  } catch (const Error& error) {
    throw refused(url, error.message());
  }
  if (!is_allowed(parsed))
    throw refused(url,
                  "expected a URL that this service allows (webhooks.allow): scheme, host and port "
                  "must be equal, and the path must be in an allowed folder");
}

bool Webhooks::is_allowed(const HttpUrl& url) const {
  return std::ranges::any_of(allowed_,
                             [&](const HttpUrl& prefix) { return is_below(url, prefix); });
}

std::string Webhooks::job_member(const Job& job) {
  const std::string url = webhook_url_of(job);
  if (url.empty()) return "null";
  using nlohmann::ordered_json;
  // Paths of webhooks can contain secrets, so clients that may read the job see only the origin.
  ordered_json json = {{"origin", ""},
                       {"state", "waiting"},
                       {"delivery", nullptr},
                       {"attempts", 0},
                       {"status", nullptr},
                       {"error", nullptr},
                       {"next_attempt_at", nullptr},
                       {"ended_at", nullptr}};
  const auto delivery = store_.newest(job.id);
  try {
    json["origin"] = parse_http_url(url).origin();
  } catch (const Error&) {
    // A damaged record. The job can still be shown.
  }
  // A job that runs again after a retry has an old delivery.
  if (delivery && (has_ended(job.state) || delivery->state == DeliveryState::kPending)) {
    const auto time_or_null = [](double unix_s) {
      return unix_s > 0 ? ordered_json(time_text(unix_s)) : ordered_json();
    };
    json["state"] = kDeliveryStateNames[static_cast<size_t>(delivery->state)];
    json["delivery"] = delivery->id;
    json["attempts"] = delivery->attempts;
    if (delivery->status > 0) json["status"] = delivery->status;
    if (!delivery->error.empty()) json["error"] = delivery->error;
    if (delivery->state == DeliveryState::kPending)
      json["next_attempt_at"] = time_or_null(delivery->next_s);
    json["ended_at"] = time_or_null(delivery->ended_s);
  }
  make_printable(json);
  return json_text(json);
}

Webhooks::Statistics Webhooks::statistics() {
  return {store_.pending_count(), ended_attempts_, delivered_, failed_};
}

void Webhooks::stop() {
  stops_ = true;
  queue_.announce();
  if (thread_.joinable()) thread_.join();
}

void Webhooks::run() {
  while (!stops_) {
    const uint64_t seen = queue_.version();
    steps_.run("record deliveries of webhooks", [this] { record_ended_attempts(); });
    steps_.run("collect the webhooks of ended jobs", [this] { collect(); });
    steps_.run("send webhooks", [this] { start_due_attempts(); });
    steps_.run("end slow webhooks", [this] { end_overdue_attempts(); });
    steps_.run("forget the webhooks of deleted jobs", [this] { forget_deleted_jobs(); });
    if (!stops_) queue_.wait_for_change(seen, max_wait_s());
  }
  for (;; std::this_thread::sleep_for(std::chrono::duration<double>(kStopIntervalS))) {
    steps_.run("record deliveries of webhooks", [this] { record_ended_attempts(); });
    if (attempts_.empty()) return;
    steps_.run("end webhooks", [this] { end_overdue_attempts(); });
  }
}

double Webhooks::max_wait_s() const {
  if (!attempts_.empty()) return kStopIntervalS;
  return std::clamp(next_due_s_ - unix_seconds(), kStopIntervalS, kMaxWebhookSleepS);
}

void Webhooks::collect() {
  const uint64_t changes = queue_.changes();
  if (changes == seen_changes_) return;
  for (size_t count = kEndsPerRead; count == kEndsPerRead;) {
    const auto ends = ended_jobs_.after(last_event_, kEndsPerRead);
    for (const JobEnd& end : ends) {
      collect(end);
      last_event_ = end.event.number;
    }
    count = ends.size();
  }
  seen_changes_ = changes;
}

void Webhooks::collect(const JobEnd& end) {
  const auto job = queue_.find(end.job);
  if (!job) return;
  Delivery delivery;
  delivery.url = webhook_url_of(*job);
  if (delivery.url.empty()) return;
  delivery.id = random_id();
  delivery.event = end.event.number;
  delivery.job = job->id;
  delivery.body = webhook_body(delivery.id, *job, end.event);
  delivery.created_s = delivery.next_s = unix_seconds();
  const bool is_full = store_.pending_count() >= kMaxPending;
  try {
    delivery.origin = parse_http_url(delivery.url).origin();
  } catch (const Error&) {
    delivery.origin = "";  // start() reports the error
  }
  if (is_full) {
    delivery.state = DeliveryState::kFailed;
    delivery.ended_s = delivery.created_s;
    delivery.error =
        "too many pending deliveries: expected less than " + std::to_string(kMaxPending);
    log_({"webhook " + delivery.id + " of job " + delivery.job + " failed: " + delivery.error,
          LogLevel::kError, delivery.job});
  }
  store_.add(delivery);
  count_end(delivery);
  looks_ = true;
}

void Webhooks::start_due_attempts() {
  const double now = wall_seconds();
  if (!looks_ && unix_seconds() < next_due_s_ && now - last_look_s_ < kMaxLookIntervalS) return;
  last_look_s_ = now;
  while (!stops_ && start_next_attempt()) {
  }
  next_due_s_ = store_.next_time_s(unix_seconds());
  looks_ = false;
}

bool Webhooks::start_next_attempt() {
  if (attempts_.size() >= kMaxActive) return false;
  std::set<std::string> active, busy;
  std::map<std::string, size_t> counts;
  for (const auto& attempt : attempts_) {
    active.insert(attempt->delivery.id);
    if (++counts[attempt->delivery.origin] == kMaxActivePerOrigin)
      busy.insert(attempt->delivery.origin);
  }
  const auto delivery = store_.next(unix_seconds(), options_.max_backoff_s, active, busy);
  if (!delivery) return false;
  start(*delivery);
  return true;
}

void Webhooks::start(const Delivery& delivery) {
  if (!queue_.find(delivery.job)) return store_.remove_job(delivery.job);
  try {
    check(delivery.url);  // the configuration may have changed since the job was submitted
  } catch (const RequestError&) {
    return fail(delivery, "the configuration of the service no longer allows the URL");
  }
  auto attempt = std::make_unique<Attempt>();
  attempt->delivery = delivery;
  attempt->deadline_s = wall_seconds() + options_.timeout_s;
  client::ClientOptions options;
  options.url = delivery.origin;
  options.ca_file = options_.ca_file;
  options.timeout_s = options_.timeout_s;
  options.connect_timeout_s = std::min(options_.timeout_s, kMaxConnectS);
  try {
    attempt->http = std::make_unique<client::HttpClient>(options);
  } catch (const Error& error) {
    return fail(delivery, error.message());
  }
  Attempt& started = *attempt;
  attempts_.push_back(std::move(attempt));
  try {
    started.thread = std::thread([this, &started] {
      send(started);
      started.end_s = wall_seconds();
      started.ended = true;
      queue_.announce();
    });
  } catch (...) {
    attempts_.pop_back();
    throw;
  }
}

void Webhooks::send(Attempt& attempt) const {
  const Delivery& delivery = attempt.delivery;
  try {
    client::HeaderMap headers = {{"Content-Type", "application/json"},
                                 {"User-Agent", "voxdag/" VOXDAG_VERSION},
                                 {"X-Voxdag-Delivery", delivery.id}};
    if (!secret_.empty())
      headers.emplace("X-Voxdag-Signature", webhook_signature(secret_, delivery.body));
    attempt.status = attempt.http->send_for_status("POST", parse_http_url(delivery.url).target,
                                                   delivery.body, headers);
    if (attempt.status < 200 || attempt.status > 299)
      attempt.error = "status " + std::to_string(attempt.status) + ": expected 200 to 299";
  } catch (const std::exception& error) {
    attempt.error = printable_line(error.what()).substr(0, kMaxErrorBytes);
  } catch (...) {
    attempt.error = "an unknown exception";
  }
}

void Webhooks::end_overdue_attempts() {
  for (const auto& attempt : attempts_) {
    attempt->is_too_long = attempt->is_too_long || attempt->http->received() > kMaxAnswerBytes;
    // A call has no effect before the socket exists, so the next pass calls it again.
    if (stops_ || attempt->is_too_long || wall_seconds() >= attempt->deadline_s)
      attempt->http->stop();
  }
}

void Webhooks::record_ended_attempts() {
  for (auto next = attempts_.begin(); next != attempts_.end();) {
    const auto at = next++;
    if (!(*at)->ended) continue;
    if ((*at)->thread.joinable()) (*at)->thread.join();
    try {
      record(**at);
    } catch (...) {
      // The next pass records the attempt. When the service stops, the next service repeats it.
      if (stops_) attempts_.erase(at);
      throw;
    }
    attempts_.erase(at);
    looks_ = true;
  }
}

void Webhooks::record(Attempt& attempt) {
  if (stops_ && !attempt.error.empty() && attempt.status == 0) return;  // ended by stop()
  Delivery& delivery = attempt.delivery;
  Delivery changed = delivery;
  const double now = unix_seconds();
  ++changed.attempts;
  changed.status = attempt.status;
  changed.error = attempt.error;
  if (attempt.status == 0 && attempt.is_too_long)
    changed.error = "the answer has over " + std::to_string(kMaxAnswerBytes) +
                    " bytes before the end of its headers";
  else if (attempt.status == 0 && attempt.end_s >= attempt.deadline_s)
    changed.error = "no answer within " + number_text(options_.timeout_s) + " s";
  const std::string what = "webhook " + delivery.id + " of job " + delivery.job + ": attempt " +
                           std::to_string(changed.attempts) + " of " +
                           std::to_string(options_.max_attempts);
  if (changed.error.empty()) {
    changed.state = DeliveryState::kDelivered;
    changed.ended_s = now;
  } else if (changed.attempts >= options_.max_attempts) {
    changed.state = DeliveryState::kFailed;
    changed.ended_s = now;
  } else {
    const double exponent = std::min(changed.attempts, 32u) - 1.0;
    changed.next_s =
        now + std::min(options_.max_backoff_s, options_.backoff_s * std::exp2(exponent));
  }
  store_.update(changed);
  ++ended_attempts_;
  count_end(changed);
  if (changed.error.empty()) return;
  const bool is_last = changed.state == DeliveryState::kFailed;
  log_({what + " failed: " + changed.error +
            (is_last ? "; the delivery has failed, and there is no further attempt" : ""),
        is_last ? LogLevel::kError : LogLevel::kWarning, delivery.job});
}

void Webhooks::count_end(const Delivery& delivery) {
  if (delivery.state == DeliveryState::kDelivered) ++delivered_;
  if (delivery.state == DeliveryState::kFailed) ++failed_;
}

void Webhooks::fail(Delivery delivery, const std::string& reason) {
  delivery.state = DeliveryState::kFailed;
  delivery.ended_s = unix_seconds();
  delivery.error = reason;
  store_.update(delivery);
  count_end(delivery);
  log_({"webhook " + delivery.id + " of job " + delivery.job + " failed: " + reason,
        LogLevel::kError, delivery.job});
}

void Webhooks::forget_deleted_jobs() {
  const double now = wall_seconds();
  if (now < next_forget_s_) return;
  next_forget_s_ = now + kForgetIntervalS;
  for (const std::string& job : store_.jobs())
    if (!queue_.find(job)) store_.remove_job(job);
  if (store_.last_event() != last_event_) store_.skip_to(last_event_);
}

}  // namespace voxdag::server
