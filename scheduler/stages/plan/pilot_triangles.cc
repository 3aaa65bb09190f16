#include "scheduler/stages/plan/pilot_triangles.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <mutex>
#include <vector>

#include "core/base/clock.h"
#include "core/base/parallel_for.h"

namespace voxdag {
namespace {

constexpr uint64_t kPilotPiece = 1 << 16;
constexpr size_t kPilotBatch = 1024;
constexpr size_t kPilotChunk = 1024;

// Streams triangles on a grid that is 2^shift times coarser. Coordinates remain odd, as
// FixedTriangle requires, so that no vertex is on a voxel boundary.
class CoarserStream : public TriangleStream {
 public:
  CoarserStream(std::unique_ptr<TriangleStream> fine, uint32_t shift)
      : fine_(std::move(fine)), shift_(shift) {}
  uint64_t count() const override { return fine_->count(); }
  void rewind() override { fine_->rewind(); }
  size_t read(std::span<FixedTriangle> out) override {
    const size_t n = fine_->read(out);
    for (FixedTriangle& triangle : out.first(n))
      for (auto& vertex : triangle.v)
        for (int64_t& u : vertex) u = (u >> shift_) | 1;
    return n;
  }

 private:
  std::unique_ptr<TriangleStream> fine_;
  const uint32_t shift_;
};

// Remembers some of the most recent triangles, to find triangles that repeat.
class RecentTriangles {
 public:
  static constexpr size_t kBytes = (size_t{1} << 14) * sizeof(FixedTriangle);

  RecentTriangles() : slots_(kBytes / sizeof(FixedTriangle)) {}
  // Remembers the triangle. Returns false if an equal triangle was already remembered.
  bool add(const FixedTriangle& triangle) {
    uint64_t hash = 0;
    for (const auto& vertex : triangle.v)
      for (const int64_t u : vertex) hash = (hash ^ static_cast<uint64_t>(u)) * 0x9e3779b97f4a7c15u;
    FixedTriangle& slot = slots_[hash >> 50];
    if (std::memcmp(&slot, &triangle, sizeof triangle) == 0) return false;
    slot = triangle;
    return true;
  }

 private:
  // Coordinates are odd, so no triangle equals an empty slot.
  std::vector<FixedTriangle> slots_;
};

// Returns false if two corners are equal. Most triangles without area have equal corners.
bool has_area(const FixedTriangle& triangle) {
  for (int i = 0; i < 3; ++i)
    if (std::memcmp(triangle.v[i], triangle.v[(i + 1) % 3], sizeof triangle.v[i]) == 0)
      return false;
  return true;
}

// The unique triangles found by one thread.
struct Found {
  RecentTriangles recent;
  std::vector<std::byte> records;
};

}  // namespace

PilotTriangles::PilotTriangles(const TriangleStore& scene, uint32_t shift, bool keeps_equal,
                               MemoryBudget& budget, const StageContext& context)
    : record_bytes_(scene.record_bytes()) {
  const uint64_t triangles = scene.count(kSceneBin);
  const size_t pieces = (triangles + kPilotPiece - 1) / kPilotPiece;
  const uint64_t of_thread =
      RecentTriangles::kBytes + (kPilotChunk + scene.max_chunk_records()) * record_bytes_;
  const auto threads = static_cast<unsigned>(std::clamp<uint64_t>(
      std::min<uint64_t>(context.threads, budget.available() / 8 / of_thread), 1, 256));
  charge_ = MemoryCharge(budget, 0, "the triangles of a pilot");
  MemoryCharge buffers(budget, 0, "the buffers of an estimate");
  is_complete_ = buffers.try_resize(threads * of_thread);
  if (!is_complete_) return;
  std::vector<Found> found(std::min<size_t>(threads, std::max<size_t>(pieces, 1)));
  std::mutex mutex;  // guards list_ and charge_
  std::atomic<bool> is_full{false};
  const auto flush = [&](Found& thread) {
    if (thread.records.empty()) return;
    const std::lock_guard lock(mutex);
    const uint64_t bytes = thread.records.size() + kChunkListBytes;
    if (is_full || !charge_.try_resize(charge_.bytes() + bytes)) {
      is_full = true;
      return;
    }
    list_.add({.memory = thread.records,
               .records = static_cast<uint32_t>(thread.records.size() / record_bytes_)});
    thread.records.clear();
  };
  context.build.progress.begin_stage("estimate", triangles, "triangles");
  const double start_s = process_cpu_seconds();
  parallel_for(threads, pieces, [&](unsigned worker, size_t piece) {
    Found& thread = found[worker];
    CoarserStream stream(scene.open(kSceneBin, piece * kPilotPiece), shift);
    std::array<FixedTriangle, kPilotBatch> batch;
    for (uint64_t left = std::min(kPilotPiece, triangles - piece * kPilotPiece);
         left > 0 && !is_full;) {
      context.build.cancel.check();
      const size_t n = stream.read(std::span(batch).first(std::min<uint64_t>(left, batch.size())));
      if (n == 0) break;
      for (const FixedTriangle& triangle : std::span(batch).first(n)) {
        if (!(keeps_equal && has_area(triangle)) && !thread.recent.add(triangle)) continue;
        const size_t end = thread.records.size();
        thread.records.resize(end + record_bytes_);
        encode_triangle(triangle, record_bytes_, thread.records.data() + end);
        if (thread.records.size() == kPilotChunk * record_bytes_) flush(thread);
      }
      left -= n;
      context.build.progress.advance(n);
    }
  });
  for (Found& thread : found) flush(thread);
  context.build.progress.end_stage();
  cpu_s_ = process_cpu_seconds() - start_s;
  is_complete_ = !is_full;
  if (is_complete_) return;
  list_ = {};
  charge_.try_resize(0);
}

std::unique_ptr<TriangleStream> PilotTriangles::open(uint32_t shift) const {
  return std::make_unique<CoarserStream>(open_chunks(list_, nullptr, record_bytes_, 0), shift);
}

}  // namespace voxdag
