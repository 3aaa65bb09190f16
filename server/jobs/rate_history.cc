#include "server/jobs/rate_history.h"

namespace voxdag::server {

void RateHistory::add(double wall_s, uint64_t done) {
  if (wall_s <= marks_.back().wall_s) return;
  const size_t size = marks_.size();
  const bool is_last_short =
      size > 1 && marks_[size - 1].wall_s - marks_[size - 2].wall_s < interval_s_;
  if (is_last_short)
    marks_.back() = {wall_s, done};
  else
    marks_.push_back({wall_s, done});
  if (marks_.size() > kMaxPoints + 1) merge_pairs();
}

void RateHistory::merge_pairs() {
  interval_s_ *= 2;
  std::vector<Mark> kept;
  for (size_t i = 0; i + 1 < marks_.size(); i += 2) kept.push_back(marks_[i]);
  kept.push_back(marks_.back());
  marks_ = std::move(kept);
}

std::vector<RateHistory::Point> RateHistory::points() const {
  std::vector<Mark> ends = marks_;
  // A short last interval would show the noise of single messages. So it is joined with the
  // interval before it.
  if (const size_t size = ends.size();
      size > 2 && ends[size - 1].wall_s - ends[size - 2].wall_s < interval_s_ / 2)
    ends.erase(ends.end() - 2);
  std::vector<Point> points;
  for (size_t i = 1; i < ends.size(); ++i) {
    const Mark &begin = ends[i - 1], &end = ends[i];
    const uint64_t done = end.done > begin.done ? end.done - begin.done : 0;
    points.push_back({end.wall_s, static_cast<double>(done) / (end.wall_s - begin.wall_s)});
  }
  return points;
}

double RateHistory::rate() const {
  const std::vector<Point> all = points();
  return all.empty() ? 0 : all.back().rate;
}

}  // namespace voxdag::server
