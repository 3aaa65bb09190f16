#include "server/tiles/partial/partial_views.h"

#include <algorithm>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "scheduler/state/work_folder.h"
#include "server/base/request_error.h"
#include "server/tiles/partial/partial_frame.h"

namespace voxdag::server {
namespace {

// Viewers of a job send requests more often than every kMinIdleS seconds. So a view that was not
// requested for this time has no viewers.
constexpr int kMinIdleS = 10;

}  // namespace

template <class Read>
auto PartialViews::read(const std::string& job, const JobFolder& folder, const Read& read) {
  const auto view = view_of(job, folder);
  try {
    return read(*view);
  } catch (const Error&) {
    if (view->is_worthless()) {
      const std::lock_guard lock(mutex_);
      entries_.remove_if([&](const Entry& entry) { return entry.view == view; });
    }
    throw;
  }
}

std::string PartialViews::json(const std::string& job, const JobFolder& folder,
                               uint64_t resolution) {
  return *read(job, folder, [&](PartialView& view) { return view.json(folder, resolution); });
}

std::shared_ptr<const TileSource> PartialViews::tiles(const std::string& job,
                                                      const JobFolder& folder,
                                                      uint64_t resolution) {
  return read(job, folder, [&](PartialView& view) { return view.tiles(folder, resolution); });
}

std::shared_ptr<const TileSource> PartialViews::known(const std::string& job,
                                                      const std::string& digest) {
  std::shared_ptr<PartialView> view;
  {
    const std::lock_guard lock(mutex_);
    view = find(job);
  }
  return view ? view->known(digest) : nullptr;
}

void PartialViews::close(const std::string& job) {
  const std::lock_guard lock(mutex_);
  entries_.remove_if([&](const Entry& entry) { return entry.view->job() == job; });
}

void PartialViews::close_stale(double max_idle_s) {
  const std::lock_guard lock(mutex_);
  const double oldest_s = wall_seconds() - max_idle_s;
  entries_.remove_if([&](const Entry& entry) { return entry.used_s < oldest_s; });
}

std::shared_ptr<PartialView> PartialViews::find(const std::string& job) {
  const auto found = std::find_if(entries_.begin(), entries_.end(),
                                  [&](const Entry& entry) { return entry.view->job() == job; });
  if (found == entries_.end()) return nullptr;
  entries_.splice(entries_.begin(), entries_, found);
  entries_.front().used_s = wall_seconds();
  return entries_.front().view;
}

std::shared_ptr<PartialView> PartialViews::view_of(const std::string& job,
                                                   const JobFolder& folder) {
  {
    const std::lock_guard lock(mutex_);
    if (auto view = find(job)) return view;
  }
  // Jobs that wait or read their scene have nothing to show and need no entry.
  if (!files_.exists(WorkFolder::store_path(folder.work())) && !is_planned(files_, folder))
    throw Error(ErrorCode::kNotFound,
                folder.work() +
                    ": the subvolumes are not planned yet: expected a job that has read its scene");
  const std::lock_guard lock(mutex_);
  if (auto view = find(job)) return view;
  if (entries_.size() == max_jobs_) {
    // A view that was requested a moment ago keeps its entry. If it were replaced, the next
    // requests of its viewers would in turn replace the entry of another job.
    if (wall_seconds() - entries_.back().used_s < kMinIdleS) {
      RequestError busy(RequestError::Kind::kBusy,
                        "too many running jobs are being viewed: expected a request after another "
                        "viewer has closed");
      busy.retry_after_s = kMinIdleS;
      throw busy;
    }
    entries_.pop_back();
  }
  entries_.push_front({std::make_shared<PartialView>(files_, job, max_words_), wall_seconds()});
  return entries_.front().view;
}

}  // namespace voxdag::server
