#include "server/tiles/partial/partial_view.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/fields/json_text.h"
#include "core/format/checksum.h"
#include "core/geometry/grid.h"
#include "core/io/random_id.h"
#include "scheduler/state/work_folder.h"
#include "server/tiles/partial/partial_frame.h"

namespace voxdag::server {
namespace {

constexpr double kReadIntervalS = 1;
constexpr double kMaxCpuShare = 0.05;  // maximum share of one core's time for reading
constexpr double kMaxReadingS = 0.5;   // maximum wall time of one reading
constexpr size_t kDagDigits = 32;

class PartialTileSource : public TileSource {
 public:
  PartialTileSource(const PartialDag& nodes, uint32_t levels, std::string digest)
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

// True if the work folder has a job store. A store without bytes is being created.
bool has_job_store(FileSystem& files, const JobFolder& folder) {
  const std::string path = WorkFolder::store_path(folder.work());
  try {
    return files.exists(path) && files.open_own(path)->size() > 0;
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound) throw;
    return false;  // the file was removed after exists() had found it
  }
}

}  // namespace

ReadLimiter::Charge::Charge(ReadLimiter& limiter)
    : limiter_(limiter), start_s_(thread_cpu_seconds()) {}

ReadLimiter::Charge::~Charge() {
  const double used_s = thread_cpu_seconds() - start_s_;
  limiter_.idle_until_s_ = std::max(limiter_.idle_until_s_, wall_seconds()) + used_s / kMaxCpuShare;
}

bool ReadLimiter::may_read() const { return wall_seconds() >= std::max(next_s_, idle_until_s_); }

void ReadLimiter::note_read() { next_s_ = wall_seconds() + kReadIntervalS; }

std::optional<uint64_t> GrowingDag::add(const CoarseCubes& cubes, uint32_t levels) {
  std::vector<PartialDag::Part> parts;
  for (const auto& [id, coarse] : cubes.cubes()) parts.push_back({coarse.cube, coarse.brick});
  std::optional<uint64_t> root;
  if (nodes_) root = nodes_->dag.add(parts);
  if (nodes_ && nodes_->dag.word_count() <= nodes_->max_words) return root;
  // If the new nodes cannot be made, the old nodes and their digest remain.
  auto nodes = std::make_unique<Nodes>(
      levels, sha256_hex("partial " + job_ + random_id()).substr(0, kDagDigits));
  root = nodes->dag.add(parts);
  nodes->max_words = std::max(max_words_, 2 * nodes->dag.word_count());
  nodes_ = std::move(nodes);
  return root;
}

std::shared_ptr<const std::string> PublishedAnswers::json() const {
  const std::lock_guard lock(mutex_);
  return json_;
}

std::shared_ptr<const TileSource> PublishedAnswers::tiles() const {
  const std::lock_guard lock(mutex_);
  return tiles_;
}

std::shared_ptr<const TileSource> PublishedAnswers::known(const std::string& digest) const {
  const std::lock_guard lock(mutex_);
  return known_ && known_->digest() == digest ? known_ : nullptr;
}

void PublishedAnswers::set_json(std::string json) {
  auto shared = std::make_shared<const std::string>(std::move(json));
  const std::lock_guard lock(mutex_);
  json_ = std::move(shared);
}

void PublishedAnswers::set_tiles(std::shared_ptr<const TileSource> tiles) {
  const std::lock_guard lock(mutex_);
  tiles_ = known_ = std::move(tiles);
}

bool PublishedAnswers::clear() {
  const std::lock_guard lock(mutex_);
  json_.reset();
  tiles_.reset();
  return known_ != nullptr;
}

std::shared_ptr<const std::string> PartialView::json(const JobFolder& folder, uint64_t resolution) {
  return read(folder, &PublishedAnswers::json, [&] { update_json(resolution); });
}

std::shared_ptr<const TileSource> PartialView::tiles(const JobFolder& folder, uint64_t resolution) {
  return read(folder, &PublishedAnswers::tiles, [&] { update_tiles(folder, resolution); });
}

template <class Answer, class Update>
Answer PartialView::read(const JobFolder& folder, Answer (PublishedAnswers::*answer)() const,
                         const Update& update) {
  std::unique_lock reading(reading_mutex_, std::try_to_lock);
  if (!reading) {
    if (auto last = (answers_.*answer)()) return last;
    reading.lock();
  }
  refresh(folder);
  update();
  return (answers_.*answer)();
}

void PartialView::refresh(const JobFolder& folder) {
  if (!limiter_.may_read()) {
    if (has_failed_)
      throw Error(ErrorCode::kInvalidInput,
                  folder.work() +
                      ": reading the finished subvolumes has just failed, and the service waits "
                      "before it tries again: expected a later request");
    return;
  }
  const ReadLimiter::Charge charge(limiter_);
  limiter_.note_read();
  has_failed_ = true;
  read_cubes(folder);
  has_failed_ = is_worthless_ = false;
  ++version_;
}

void PartialView::read_cubes(const JobFolder& folder) {
  try {
    cubes_.refresh(files_, folder.work(), kMaxReadingS);
    if (cubes_.total() > 0) return;
    throw Error(ErrorCode::kNotFound,
                folder.work() +
                    ": the subvolumes are not planned yet: expected a job that has read its scene");
  } catch (const Error& error) {
    // The job's process may have removed the folder while it was being read.
    if (error.code() != ErrorCode::kNotFound && has_job_store(files_, folder)) throw;
    if (!is_planned(files_, folder)) {
      restart();
      throw Error(ErrorCode::kNotFound, error.message());
    }
  }
  if (cubes_.built() > 0) restart();
  cubes_.show_plan(read_planned_total(files_, folder));
  frame_ = nullptr;  // a restarted job may still have the list of an earlier run
}

// Forgets everything that was read, because the job's folder was removed. If the folder is created
// again, the job may build a scene with a different grid.
void PartialView::restart() {
  cubes_ = {};
  frame_ = nullptr;
  nodes_.clear();
  merged_.reset();
  is_worthless_ = !answers_.clear();
}

void PartialView::update_json(uint64_t resolution) {
  if (json_version_ == version_) return;
  const ReadLimiter::Charge charge(limiter_);
  answers_.set_json(describe_cubes(cubes_, resolution));
  json_version_ = version_;
}

void PartialView::find_frame(const JobFolder& folder, uint64_t resolution) {
  if (!frame_.is_null()) return;
  // Calls read_frame() once per reading of the work folder. If an earlier call with this version
  // failed, the list of the subvolumes does not exist yet or is damaged.
  if (std::exchange(frame_version_, version_) == version_)
    throw Error(ErrorCode::kNotFound,
                folder.subvolumes() +
                    " is missing or unreadable: expected the list of the planned subvolumes");
  frame_ = read_frame(files_, folder, resolution);
}

nlohmann::ordered_json PartialView::make_manifest(const TileSource& tiles,
                                                  std::optional<uint64_t> root) const {
  nlohmann::ordered_json manifest = manifest_of(tiles.dag(), tiles.digest(), {}, root);
  manifest.update(frame_);
  manifest["built"] = cubes_.built();
  manifest["total"] = cubes_.total();
  return manifest;
}

void PartialView::update_tiles(const JobFolder& folder, uint64_t resolution) {
  if (tiles_version_ == version_) return;
  const ReadLimiter::Charge charge(limiter_);
  find_frame(folder, resolution);
  const uint32_t levels = levels_of_resolution(resolution);
  if (merged_ && !merged_->is_broken() && !merged_->was_overwritten()) {
    tiles_version_ = version_;
    return;
  }
  if (const auto merged = MergedLevels::open(files_, folder, levels)) {
    nlohmann::ordered_json manifest = make_manifest(*merged, uint64_t{0});
    manifest["built"] = manifest["total"];  // rows of built subvolumes may not be on the disk yet
    manifest["merged"] = true;
    merged->set_manifest(exact_json_text(manifest));
    merged_ = merged;
    nodes_.clear();
    tiles_version_ = version_;
    return answers_.set_tiles(merged);
  }
  merged_.reset();
  const auto root = nodes_.add(cubes_, levels);
  auto tiles = std::make_shared<PartialTileSource>(nodes_.dag(), levels, nodes_.digest());
  tiles->set_manifest(exact_json_text(make_manifest(*tiles, root)));
  tiles_version_ = version_;
  answers_.set_tiles(std::move(tiles));
}

}  // namespace voxdag::server
