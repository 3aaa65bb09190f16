// Runs long work for a Python caller. The work runs on a new thread without the interpreter's
// lock. The calling thread waits for the work, handles signals (Ctrl-C raises
// KeyboardInterrupt) and forwards progress and warnings to Python. So Python code runs only on
// the calling thread.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include <chrono>
#include <future>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "voxdag/cancel_token.h"

namespace voxdag::python {

namespace nb = nanobind;

// Stores the newest progress of the work. Also stores warnings until take_warnings() returns them.
// Thread-safe: the work and the calling thread use it concurrently.
class LatestProgress : public Progress {
 public:
  struct State {
    std::string stage, unit;
    uint64_t done = 0, total = 0;
    friend bool operator==(const State&, const State&) = default;
  };

  void begin_stage(std::string_view stage, uint64_t total, std::string_view unit) override;
  void resume_at(uint64_t done) override;
  void advance(uint64_t count) override;
  void set_total(uint64_t total) override;
  void end_stage() override;
  void warn(std::string_view message) override;

  State state() const;
  std::vector<std::string> take_warnings();

 private:
  mutable std::mutex mutex_;
  State state_;
  std::vector<std::string> warnings_;
};

// Interval at which the calling thread checks for signals and new progress, and whether the work
// has ended.
inline constexpr std::chrono::milliseconds kLookInterval{50};

// Forwards warnings and new progress to Python. pass_on() calls callback(stage, done, total, unit)
// if the progress has changed and `callback` is not None. pass_on() raises the exceptions of the
// called Python code, and KeyboardInterrupt after Ctrl-C.
class Messenger {
 public:
  explicit Messenger(nb::object callback) : callback_(std::move(callback)) {}
  void pass_on(LatestProgress& progress);

 private:
  nb::object callback_;
  LatestProgress::State last_;
};

// Returns work(progress, cancel) or throws its exception. If Python code raises an exception during
// the work, cancels the work and raises the Python exception instead.
template <class Work>
auto run_long_work(nb::object callback, Work work) {
  LatestProgress progress;
  CancelToken cancel;
  Messenger messenger(std::move(callback));
  auto result = std::async(std::launch::async, [&] { return work(progress, cancel); });
  std::optional<nb::python_error> raised;
  for (bool ends = false; !ends;) {
    {
      const nb::gil_scoped_release released;
      ends = result.wait_for(kLookInterval) == std::future_status::ready;
    }
    if (raised) continue;
    try {
      messenger.pass_on(progress);
    } catch (nb::python_error& error) {
      raised.emplace(std::move(error));
      cancel.cancel();
    }
  }
  if (raised) throw std::move(*raised);
  return result.get();
}

}  // namespace voxdag::python
