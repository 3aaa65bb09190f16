#include "server/tiles/partial_views.h"

#include <algorithm>
#include <bit>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/dag/brick.h"
#include "core/format/checksum.h"
#include "core/geometry/grid.h"
#include "core/io/random_id.h"
#include "query/render/views.h"
#include "scheduler/state/work_folder.h"
#include "server/http/problem.h"

namespace voxdag::server {
namespace {

using PartialJson = nlohmann::ordered_json;

constexpr double kInterval_s = 1;
constexpr double kMaxShare = 0.05;  // of one core
constexpr size_t kIdDigits = 32;
constexpr uint64_t kMaxPlanBytes = uint64_t{1} << 30;
constexpr double kMaxRead_s = 0.5;  // of a look at the folder
// Who looks at a job asks for it more often than that.
constexpr double kMinIdle_s = 10;

std::string describe_cubes(const CoarseCubes& cubes, uint64_t resolution) {
  const uint32_t levels = levels_of_resolution(resolution);
  nlohmann::json list = nlohmann::json::array();
  for (const auto& [id, coarse] : cubes.cubes()) {
    const Cube& cube = coarse.cube;
    const int64_t edge = cube.edge_voxels(levels);
    list.push_back({cube.position[0] * edge, cube.position[1] * edge, cube.position[2] * edge, edge,
                    static_cast<uint32_t>(coarse.brick),
                    static_cast<uint32_t>(coarse.brick >> 32)});
  }
  return PartialJson{{"resolution", resolution},
                     {"built", cubes.built()},
                     {"total", cubes.total()},
                     {"cubes", std::move(list)}}
      .dump();
}

// The planned subvolumes, all of them solid, from the list that the job's process wrote.
std::vector<PartialDag::Part> planned_parts(const nlohmann::json& plan, uint64_t resolution) {
  const uint32_t levels = levels_of_resolution(resolution);
  std::vector<PartialDag::Part> parts;
  for (const auto& entry : plan.at("cubes")) {
    const uint64_t edge = entry.at(3).get<uint64_t>();
    const auto is_outside = [&](uint64_t at) { return at >= resolution || at % edge != 0; };
    if (!std::has_single_bit(edge) || edge < uint64_t{kBrickEdge} || edge > resolution ||
        is_outside(entry.at(0)) || is_outside(entry.at(1)) || is_outside(entry.at(2)))
      throw Error(ErrorCode::kCorrupt, "the list of the subvolumes has one that is none");
    Cube cube{levels - levels_of_resolution(edge), {}};
    for (size_t axis = 0; axis < 3; ++axis)
      cube.position[axis] = static_cast<uint32_t>(entry.at(axis).get<uint64_t>() / edge);
    parts.push_back({cube, ~uint64_t{0}});
  }
  return parts;
}

class PartialViewed : public ViewedDag {
 public:
  PartialViewed(const PartialDag& nodes, uint32_t levels, std::string digest)
      : copy_(nodes, levels), digest_(std::move(digest)) {}
  void set_manifest(std::string manifest) { manifest_ = std::move(manifest); }

  const query::DagView& dag() const override { return copy_.view(); }
  const std::string& digest() const override { return digest_; }
  const std::string& manifest(const CancelToken&) const override { return manifest_; }

 private:
  const PartialDagCopy copy_;
  const std::string digest_;
  std::string manifest_;
};

// The place of the grid, and a camera that sees all that is planned.
PartialJson frame_of(FileSystem& files, const JobFolder& folder, uint64_t resolution) {
  if (!files.exists(folder.subvolumes()))
    throw Error(ErrorCode::kNotFound, "the subvolumes are not planned yet");
  const uint32_t levels = levels_of_resolution(resolution);
  try {
    const auto plan =
        nlohmann::json::parse(read_small_file(files, folder.subvolumes(), kMaxPlanBytes));
    const GridPlace place{plan.at("origin"), plan.at("edge")};
    PartialJson frame = {{"origin", place.origin}, {"edge", place.edge}};
    PartialDag nodes(levels);
    // Of a DAG that is made at once, the root is the only node of its level.
    if (nodes.add(planned_parts(plan, resolution))) {
      const PartialDagCopy planned(nodes, levels);
      const CancelToken never;
      query::NamedViews views(planned.view(), never);
      frame["box"] = {{"low", views.box().low.v}, {"high", views.box().high.v}};
      frame["camera"] = camera_of("iso", views, planned.view(), place);
    }
    return frame;
  } catch (const nlohmann::json::exception&) {
    throw Error(ErrorCode::kCorrupt, "the list of the subvolumes is damaged");
  }
}

// Adds to a time what the CPU does until the end of the scope, many times over.
class Payment {
 public:
  explicit Payment(double& until_s) : until_s_(until_s) {}
  ~Payment() {
    const double used_s = thread_cpu_seconds() - start_s_;
    until_s_ = std::max(until_s_, wall_seconds()) + used_s / kMaxShare;
  }

 private:
  double& until_s_;
  const double start_s_ = thread_cpu_seconds();
};

}  // namespace

std::string PartialViews::json(const std::string& job, const JobFolder& folder,
                               uint64_t resolution) {
  const auto view = view_of(job, folder);
  return *look(*view, folder, &View::json, [&] { update_json(*view, resolution); });
}

std::shared_ptr<const ViewedDag> PartialViews::dag(const std::string& job, const JobFolder& folder,
                                                   uint64_t resolution) {
  const auto view = view_of(job, folder);
  return look(*view, folder, &View::dag, [&] { update_dag(*view, folder, resolution); });
}

std::shared_ptr<const ViewedDag> PartialViews::known(const std::string& job,
                                                     const std::string& digest) {
  std::shared_ptr<View> view;
  {
    const std::lock_guard lock(mutex_);
    view = find(job);
  }
  if (!view) return nullptr;
  const std::lock_guard lock(view->mutex);
  return view->known_dag && view->known_dag->digest() == digest ? view->known_dag : nullptr;
}

void PartialViews::close(const std::string& job) {
  const std::lock_guard lock(mutex_);
  views_.remove_if([&](const auto& view) { return view->job == job; });
}

void PartialViews::close_stale(double max_idle_s) {
  const std::lock_guard lock(mutex_);
  const double oldest_s = wall_seconds() - max_idle_s;
  views_.remove_if([&](const auto& view) { return view->used_s < oldest_s; });
}

template <class Answer, class Update>
std::shared_ptr<const Answer> PartialViews::look(View& view, const JobFolder& folder,
                                                 std::shared_ptr<const Answer> View::*answer,
                                                 const Update& update) {
  const auto last = [&] {
    const std::lock_guard lock(view.mutex);
    return view.*answer;
  };
  std::unique_lock work(view.work_mutex, std::try_to_lock);
  if (!work) {
    if (auto before = last()) return before;
    work.lock();
  }
  refresh(view, folder.work());
  update();
  return last();
}

void PartialViews::refresh(View& view, const std::string& work_folder) {
  if (wall_seconds() < std::max(view.next_s, view.paid_until_s)) {
    if (view.failed)
      throw Error(ErrorCode::kInvalidInput, work_folder + ": nothing could be read a moment ago");
    return;
  }
  const Payment payment(view.paid_until_s);
  // Also if this fails.
  view.next_s = wall_seconds() + kInterval_s;
  view.failed = true;
  try {
    view.cubes.refresh(files_, work_folder, kMaxRead_s);
    if (view.cubes.total() == 0)
      throw Error(ErrorCode::kNotFound, "the subvolumes are not planned yet");
  } catch (const Error& error) {
    // The job's process may have removed the folder while it was read here.
    if (error.code() != ErrorCode::kNotFound && files_.exists(WorkFolder::store_path(work_folder)))
      throw;
    begin_again(view);
    throw Error(ErrorCode::kNotFound, error.message());
  }
  view.failed = false;
  ++view.version;
}

// What is built next may be another scene, elsewhere.
void PartialViews::begin_again(View& view) {
  view.cubes = {};
  view.frame = nullptr;
  view.nodes.reset();
  bool is_known;
  {
    const std::lock_guard lock(view.mutex);
    view.json.reset();
    view.dag.reset();
    is_known = view.known_dag != nullptr;
  }
  if (is_known) return;
  // There is nothing to remember of a job that has shown nothing.
  const std::lock_guard lock(mutex_);
  views_.remove_if([&](const auto& each) { return each.get() == &view; });
}

void PartialViews::update_json(View& view, uint64_t resolution) {
  if (view.json_version == view.version) return;
  const Payment payment(view.paid_until_s);
  auto json = std::make_shared<const std::string>(describe_cubes(view.cubes, resolution));
  view.json_version = view.version;
  const std::lock_guard lock(view.mutex);
  view.json = std::move(json);
}

void PartialViews::update_dag(View& view, const JobFolder& folder, uint64_t resolution) {
  if (view.dag_version == view.version) return;
  const Payment payment(view.paid_until_s);
  const uint32_t levels = levels_of_resolution(resolution);
  if (view.frame.is_null()) {
    // Until it goes well, once for each look at the folder; then never again.
    if (std::exchange(view.frame_version, view.version) == view.version)
      throw Error(ErrorCode::kNotFound, "the subvolumes were not planned a moment ago");
    view.frame = frame_of(files_, folder, resolution);
  }
  std::vector<PartialDag::Part> parts;
  for (const auto& [id, coarse] : view.cubes.cubes()) parts.push_back({coarse.cube, coarse.brick});
  std::optional<uint64_t> root;
  if (view.nodes) root = view.nodes->dag.add(parts);
  if (!view.nodes || view.nodes->dag.word_count() > view.nodes->max_words) {
    // Nodes and their digest are replaced at once, or not at all.
    auto nodes = std::make_unique<Nodes>(
        levels, sha256_hex("partial " + view.job + random_id()).substr(0, kIdDigits));
    root = nodes->dag.add(parts);
    nodes->max_words = std::max(max_words_, 2 * nodes->dag.word_count());
    view.nodes = std::move(nodes);
  }
  auto dag = std::make_shared<PartialViewed>(view.nodes->dag, levels, view.nodes->digest);
  PartialJson manifest = manifest_of(dag->dag(), dag->digest(), {}, root);
  manifest.update(view.frame);
  manifest["built"] = view.cubes.built();
  manifest["total"] = view.cubes.total();
  dag->set_manifest(manifest.dump());
  view.dag_version = view.version;
  const std::lock_guard lock(view.mutex);
  view.dag = view.known_dag = std::move(dag);
}

std::shared_ptr<PartialViews::View> PartialViews::find(const std::string& job) {
  const auto found = std::find_if(views_.begin(), views_.end(),
                                  [&](const auto& view) { return view->job == job; });
  if (found == views_.end()) return nullptr;
  views_.splice(views_.begin(), views_, found);
  views_.front()->used_s = wall_seconds();
  return views_.front();
}

std::shared_ptr<PartialViews::View> PartialViews::view_of(const std::string& job,
                                                          const JobFolder& folder) {
  {
    const std::lock_guard lock(mutex_);
    if (auto view = find(job)) return view;
  }
  // Of jobs that wait there is nothing to remember.
  if (!files_.exists(WorkFolder::store_path(folder.work())))
    throw Error(ErrorCode::kNotFound, folder.work() + " has no job store");
  const std::lock_guard lock(mutex_);
  if (auto view = find(job)) return view;
  if (views_.size() == max_jobs_) {
    // One that is looked at stays: its viewers would begin again, and so on in turn.
    if (wall_seconds() - views_.back()->used_s < kMinIdle_s)
      throw busy("too many running jobs are looked at", static_cast<int>(kMinIdle_s));
    views_.pop_back();
  }
  views_.push_front(std::make_shared<View>(job));
  views_.front()->used_s = wall_seconds();
  return views_.front();
}

}  // namespace voxdag::server
