#include "scheduler/state/checkpoint/ingest_checkpoint.h"

#include <algorithm>
#include <chrono>

#include "core/base/background.h"
#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/text.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/triangles/memory_store.h"

namespace voxdag {
namespace {

// Upper bounds, in ns, of the steps in which the clock for file times advances. A step is usually
// at most ten milliseconds. If no time of a file has a fraction of a second, it is possible that
// its file system stores times with steps of up to two seconds.
constexpr int64_t kSecondNs = 1'000'000'000;
constexpr int64_t kTickNs = kSecondNs / 10;
constexpr int64_t kCoarseTickNs = 2 * kSecondNs;
// Records per triangle in the file after the partition: one in the scene's bin, and one in the bin
// of each cube that the triangle touches.
constexpr double kDurableCopies = 2.2;
// Triangles that fit in memory get checkpoints only if the free disk space is at least this many
// times the size of their records in the file. The records need this size once, and the rest of the
// build as much again.
constexpr double kFreePerCopy = 2;

std::string request_of(const BuildSpec& spec) {
  std::string request = geometry_json(spec.geometry);
  for (const std::string& scene : spec.geometry.scenes) request += '\0' + scene;
  return request;
}

bool is_wide(const BuildSpec& spec) { return spec.geometry.bounds.has_value(); }

double copies_bytes(const BuildSpec& spec, uint64_t triangles) {
  return kDurableCopies * static_cast<double>(triangles) *
         static_cast<double>(triangle_record_bytes(is_wide(spec)));
}

double triangle_memory(const BuildSpec& spec) {
  return static_cast<double>(MemoryPlan::divide(spec.run.memory_bytes).triangle_bytes);
}

bool fits_in_memory(const BuildSpec& spec, uint64_t triangles) {
  return copies_bytes(spec, triangles) <= triangle_memory(spec);
}

}  // namespace

double max_disk_bytes(const BuildSpec& spec, uint64_t triangles, uint64_t records) {
  const double bytes = copies_bytes(spec, std::max(triangles, records));
  if (triangles >= spec.run.durable_min_triangles) return bytes;
  return std::max(0.0, bytes - triangle_memory(spec));
}

int64_t trusted_from_ns(const std::vector<SourceFile>& files) {
  int64_t trusted = 0;
  for (const auto& [path, identity] : files) {
    if (identity == FileIdentity{}) return INT64_MAX;
    const bool whole_seconds =
        identity.modified_ns % kSecondNs == 0 && identity.changed_ns % kSecondNs == 0;
    trusted = std::max(trusted, std::max(identity.modified_ns, identity.changed_ns) +
                                    (whole_seconds ? kCoarseTickNs : kTickNs));
  }
  return trusted;
}

IngestCheckpoint::IngestCheckpoint(const BuildSpec& spec, JobStore* jobs, WorkFolder& work,
                                   const BuildContext& context)
    : spec_(spec), jobs_(jobs), work_(work), context_(context), is_disabled_(!jobs) {}

std::optional<IngestState> IngestCheckpoint::resume() {
  wait();
  store_ = nullptr;
  record_.reset();
  if (!jobs_) return std::nullopt;
  last_save_s_ = wall_seconds();
  try {
    if (const auto stored = jobs_->ingest()) record_ = decode_ingest_record(*stored);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCorrupt && error.code() != ErrorCode::kUnsupportedVersion)
      throw;
    context_.progress.warn(error.message() + "; the scene is read again");
    jobs_->forget_ingest();
  }
  if (!record_) {
    work_.remove_durable();
    return std::nullopt;
  }
  // At stage kReady the triangles are only in the bins of the planned cubes. The plan is stored
  // with the job, so without a job such a checkpoint is useless.
  if (record_->request == request_of(spec_) && files_are_unchanged() &&
      (record_->state.stage != IngestStage::kReady || jobs_->job()))
    return record_->state;
  // Keeps the saved checkpoint until enable() replaces it, because it is possible that the files of
  // its scene are only temporarily unreachable.
  record_.reset();
  return std::nullopt;
}

bool IngestCheckpoint::is_worthwhile(const TriangleSource& scene) const {
  const uint64_t triangles = scene.declared_triangles();
  if (is_disabled_ || triangles < spec_.run.durable_min_triangles) return false;
  return !fits_in_memory(spec_, triangles) ||
         kFreePerCopy * copies_bytes(spec_, triangles) <=
             static_cast<double>(context_.files.free_space(work_.path()));
}

void IngestCheckpoint::check_disk_space(const TriangleSource& scene) const {
  // If the options give the bounds, it is possible that all triangles are outside the grid, where
  // they need no space.
  if (spec_.run.force || spec_.geometry.bounds) return;
  const double bytes = static_cast<double>(scene.declared_triangles()) *
                       static_cast<double>(triangle_record_bytes(is_wide(spec_)));
  const double memory = triangle_memory(spec_);
  const double free = static_cast<double>(context_.files.free_space(work_.path()));
  if (bytes - memory > free)
    throw DoesNotFit(
        "the scene has " + std::to_string(scene.declared_triangles()) + " triangles, which take " +
        size_text(static_cast<uint64_t>(bytes)) + " until they are built: memory has space for " +
        size_text(static_cast<uint64_t>(memory)) + " of them, " + work_.path() + " for " +
        size_text(static_cast<uint64_t>(free)) + ": expected more free space");
}

void IngestCheckpoint::enable(const TriangleSource& scene, std::vector<SourceFile> files,
                              int64_t opened_ns) {
  forget();
  if (trusted_from_ns(files) > opened_ns) return;
  record_ = IngestRecord{request_of(spec_), std::move(files), {}};
  record_->state.declared_triangles = scene.declared_triangles();
  last_save_s_ = wall_seconds();
}

bool IngestCheckpoint::matches(const std::vector<SourceFile>& files) const {
  return record_ && record_->files == files;
}

std::unique_ptr<TriangleStore> IngestCheckpoint::open_store(const IngestState& state,
                                                            MemoryBudget& share) {
  store_ = nullptr;
  const bool is_finished = state.stage == IngestStage::kReady && state.triangles.file_end == 0;
  if (!record_ || is_finished)
    return std::make_unique<MemoryStore>(context_.files, work_.spill_path(), is_wide(spec_), share);
  auto store = std::make_unique<DurableStore>(context_.files, work_.durable_path(), state.triangles,
                                              work_.spill_path(), is_wide(spec_), share);
  store_ = store.get();
  return store;
}

bool IngestCheckpoint::has_top_tree(const IngestState& state) const {
  return store_ && state.top_tree.bytes;
}

void IngestCheckpoint::load_top_tree(const IngestState& state, std::span<std::byte> cells) const {
  store_->file()->read(state.top_tree, cells);
}

bool IngestCheckpoint::is_due() {
  if (pending_.valid()) {
    if (pending_.wait_for(std::chrono::seconds(0)) == std::future_status::timeout) return false;
    wait();
  }
  return record_ && wall_seconds() - last_save_s_ >= spec_.run.checkpoint_interval_s;
}

void IngestCheckpoint::wait() {
  if (pending_.valid()) pending_.get();
}

void IngestCheckpoint::wait_ignoring_errors() {
  try {
    wait();
  } catch (const Error&) {
    // The previous checkpoint remains valid.
  }
}

void IngestCheckpoint::save(IngestState& state, std::optional<TopTreeCells> top) {
  save_in_background(state, top);
  wait();
}

void IngestCheckpoint::save_in_background(IngestState& state, std::optional<TopTreeCells> top) {
  wait();
  if (!record_) return;
  last_save_s_ = wall_seconds();
  // Without a durable store only the record is saved. The scan, for example, stores no triangles.
  if (!store_) return commit(state);
  const std::shared_ptr<TriangleFile> file = store_->file();
  if (top) {
    state.top_tree = file->append(top->cells);
    state.top_tree_weight = top->total_weight;
  }
  state.triangles = store_->checkpoint();
  pending_ = run_in_background([this, state, file] {
    file->sync();
    const Extent old = record_->state.top_tree;
    commit(state);
    if (old.bytes && old.offset != state.top_tree.offset) file->release(old);
  });
  // An interval of 0, for tests, makes a checkpoint durable after every piece.
  if (spec_.run.checkpoint_interval_s == 0) wait();
}

void IngestCheckpoint::finish() {
  wait();
  if (!record_) return;
  IngestState state = record_->state;
  state.top_tree = {};
  state.triangles = {};
  commit(state);
  work_.remove_durable();
}

void IngestCheckpoint::commit(const IngestState& state) {
  if (!files_are_unchanged()) {
    record_.reset();
    return forget_saved();
  }
  record_->state = state;
  jobs_->save_ingest(encode(*record_));
}

bool IngestCheckpoint::has_saved() {
  wait_ignoring_errors();
  try {
    return jobs_->ingest().has_value();
  } catch (const Error&) {
    return false;
  }
}

void IngestCheckpoint::forget() {
  wait_ignoring_errors();
  record_.reset();
  forget_saved();
}

void IngestCheckpoint::forget_saved() {
  if (!jobs_) return;
  // The file is removed first. On a full disk, it can be the only source of the free space that a
  // commit of the job store needs.
  work_.remove_durable();
  jobs_->forget_ingest();
}

void IngestCheckpoint::disable() {
  is_disabled_ = true;
  forget();
}

bool IngestCheckpoint::is_optional() {
  wait_ignoring_errors();
  return record_ && fits_in_memory(spec_, record_->state.declared_triangles);
}

bool IngestCheckpoint::files_are_unchanged() const {
  try {
    return std::ranges::all_of(record_->files, [&](const SourceFile& file) {
      return context_.files.open_read(file.path)->identity() == file.identity;
    });
  } catch (const Error&) {
    return false;  // The error is reported when the scene is read.
  }
}

}  // namespace voxdag
