#include "scheduler/ingest/ingest_checkpoint.h"

#include <algorithm>
#include <chrono>
#include <system_error>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "scheduler/plan/prepare.h"

namespace voxdag {
namespace {

// Clocks of file systems stand still for up to 10 ms; those that count whole seconds, for up to
// two.
constexpr int64_t kSecond_ns = 1'000'000'000;
constexpr int64_t kTick_ns = kSecond_ns / 10;
constexpr int64_t kCoarseTick_ns = 2 * kSecond_ns;
// All triangles lie in the file twice while they are handed down, some more often.
constexpr double kCopies = 2.2;
// ... and that must leave as much again to the build.
constexpr double kRoom = 2 * kCopies;

std::string request_of(const BuildSpec& spec) {
  std::string request = geometry_json(spec.geometry);
  for (const std::string& scene : spec.geometry.scenes) request += '\0' + scene;
  return request;
}

double copies_bytes(const BuildSpec& spec, uint64_t triangles) {
  return kCopies * static_cast<double>(triangles) *
         static_cast<double>(TriangleBins::record_bytes(spec.geometry.bounds.has_value()));
}

bool fits_in_memory(const BuildSpec& spec, uint64_t triangles) {
  return copies_bytes(spec, triangles) <=
         static_cast<double>(triangle_share(spec.run.memory_bytes));
}

}  // namespace

double max_kept_bytes(const BuildSpec& spec, uint64_t triangles) {
  return triangles < spec.run.kept_from_triangles ? 0 : copies_bytes(spec, triangles);
}

int64_t unix_ns() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return now.tv_sec * kSecond_ns + now.tv_nsec;
}

int64_t settled_ns(const std::vector<SourceFile>& files) {
  int64_t settled = 0;
  for (const auto& [path, identity] : files) {
    if (identity == FileIdentity{}) return INT64_MAX;
    const bool whole_seconds =
        identity.modified_ns % kSecond_ns == 0 && identity.changed_ns % kSecond_ns == 0;
    settled = std::max(settled, std::max(identity.modified_ns, identity.changed_ns) +
                                    (whole_seconds ? kCoarseTick_ns : kTick_ns));
  }
  return settled;
}

IngestCheckpoint::IngestCheckpoint(const BuildSpec& spec, JobStore& store, WorkFolder& work,
                                   const BuildContext& context)
    : spec_(spec), store_(store), work_(work), context_(context) {}

std::optional<IngestState> IngestCheckpoint::resume() {
  settle();
  record_.reset();
  begun_s_ = wall_seconds();
  try {
    if (const auto stored = store_.ingest()) record_ = decode_ingest_record(*stored);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCorrupt && error.code() != ErrorCode::kUnsupportedVersion)
      throw;
    context_.progress.warn(error.message() + "; the scene is read again");
    store_.forget_ingest();
  }
  if (!record_) {
    work_.remove_kept();
    return std::nullopt;
  }
  // Without a job there is no plan that the triangles could have been handed down to.
  if (record_->request == request_of(spec_) && files_are_unchanged() &&
      (record_->state.stage != IngestStage::kReady || store_.job()))
    return record_->state;
  // It stays until another scene is there to take its place: this one may only be out of reach.
  record_.reset();
  return std::nullopt;
}

bool IngestCheckpoint::wants(const TriangleSource& scene) const {
  const uint64_t triangles = scene.declared_triangles();
  if (gave_up_ || max_kept_bytes(spec_, triangles) == 0) return false;
  return !fits_in_memory(spec_, triangles) ||
         kRoom / kCopies * copies_bytes(spec_, triangles) <=
             static_cast<double>(context_.files.free_space(work_.path()));
}

void IngestCheckpoint::begin(const TriangleSource& scene, int64_t opened_ns) {
  forget();
  std::vector<SourceFile> files = scene.files();
  if (settled_ns(files) > opened_ns) return;
  record_ = IngestRecord{request_of(spec_), std::move(files), {}};
  record_->state.declared_triangles = scene.declared_triangles();
  begun_s_ = wall_seconds();
}

bool IngestCheckpoint::is_of(const std::vector<SourceFile>& files) const {
  return record_ && record_->files == files;
}

std::unique_ptr<TriangleFile> IngestCheckpoint::open_file(uint64_t end) {
  return std::make_unique<TriangleFile>(context_.files, work_.kept_path(), end);
}

bool IngestCheckpoint::is_due() {
  if (pending_.valid()) {
    if (pending_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return false;
    settle();
  }
  return record_ && wall_seconds() - begun_s_ >= spec_.run.checkpoint_interval_s;
}

void IngestCheckpoint::settle() {
  if (pending_.valid()) pending_.get();
}

void IngestCheckpoint::settle_whatever_comes() {
  try {
    settle();
  } catch (const Error&) {
    // The checkpoint before it counts.
  }
}

void IngestCheckpoint::save(IngestState& state, TriangleBins& bins) {
  save_soon(state, bins);
  settle();
}

void IngestCheckpoint::save_soon(IngestState& state, TriangleBins& bins) {
  settle();
  if (!record_) return;
  begun_s_ = wall_seconds();
  const std::shared_ptr<TriangleFile> file = bins.kept_file();
  state.chunks = bins.write_chain();
  state.file_end = file->end();
  const auto checkpoint = [this, state, file] {
    file->sync();
    const Extent old = record_->state.top_tree;
    commit(state);
    if (old.bytes && old.offset != state.top_tree.offset) file->release(old);
  };
  try {
    pending_ = std::async(std::launch::async, checkpoint);
  } catch (const std::system_error&) {
    checkpoint();  // The system has no thread left.
  }
  // Tests want a checkpoint after every batch.
  if (spec_.run.checkpoint_interval_s == 0) settle();
}

void IngestCheckpoint::save_scan(const IngestState& state) {
  begun_s_ = wall_seconds();
  if (record_) commit(state);
}

void IngestCheckpoint::finish() {
  settle();
  if (!record_) return;
  IngestState state = record_->state;
  state.chunks = state.cubes = state.top_tree = {};
  state.file_end = 0;
  commit(state);
  work_.remove_kept();
}

void IngestCheckpoint::commit(const IngestState& state) {
  if (!files_are_unchanged()) {
    record_.reset();
    return forget_saved();
  }
  record_->state = state;
  store_.save_ingest(encode(*record_));
}

bool IngestCheckpoint::has_saved() {
  settle_whatever_comes();
  try {
    return store_.ingest().has_value();
  } catch (const Error&) {
    return false;
  }
}

void IngestCheckpoint::forget() {
  settle_whatever_comes();
  record_.reset();
  forget_saved();
}

void IngestCheckpoint::forget_saved() {
  // The file first: that may be the room in which the job store commits.
  work_.remove_kept();
  store_.forget_ingest();
}

void IngestCheckpoint::give_up() {
  gave_up_ = true;
  forget();
}

bool IngestCheckpoint::is_optional() {
  settle_whatever_comes();
  return record_ && fits_in_memory(spec_, record_->state.declared_triangles);
}

bool IngestCheckpoint::files_are_unchanged() const {
  try {
    return std::ranges::all_of(record_->files, [&](const SourceFile& file) {
      return context_.files.open_read(file.path)->identity() == file.identity;
    });
  } catch (const Error&) {
    return false;  // Whoever reads the scene will say what is wrong.
  }
}

}  // namespace voxdag
