// A coarse view of the subvolumes that one job has built so far, as a list and as a DAG. Once the
// job has merged all levels, the DAG is the job's complete DAG, without colors.
//
//  1. At most once per second, the thread of one request reads the job's folder. Other requests
//     get the previous answer. Reading and converting take at most a twentieth of a core.
//  2. One reading handles a limited number of subvolumes, so a large job appears in several steps.
//  3. Within one digest, the address of a node never changes. A new digest replaces all nodes in
//     one step.
//
// Thread-safe.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "core/io/file_system.h"
#include "server/jobs/protocol/job_folder.h"
#include "server/tiles/partial/coarse_cubes.h"
#include "server/tiles/partial/merged_levels.h"
#include "server/tiles/partial/partial_dag.h"
#include "server/tiles/tile_source.h"

namespace voxdag::server {

// Limits how often, and for how much CPU time, a job's folder is read. Used by one thread.
class ReadLimiter {
 public:
  // Measures the CPU time that this thread uses while this object exists, and charges it to the
  // limiter.
  class Charge {
   public:
    explicit Charge(ReadLimiter& limiter);
    ~Charge();
    Charge(const Charge&) = delete;

   private:
    ReadLimiter& limiter_;
    const double start_s_;
  };

  bool may_read() const;
  void note_read();

 private:
  double next_s_ = 0;        // in wall_seconds(): one interval after the last read
  double idle_until_s_ = 0;  // in wall_seconds(): end of the pause that limits the CPU share
};

// The DAG of the built subvolumes. It grows and keeps its digest until it has too many words,
// because nodes that only earlier roots use remain in the DAG. Then a new DAG is built, with a new
// digest. Used by one thread.
class GrowingDag {
 public:
  GrowingDag(std::string job, uint64_t max_words) : job_(std::move(job)), max_words_(max_words) {}

  // Adds the new cubes of `cubes`. Returns the root's word offset; nullopt if nothing is built.
  std::optional<uint64_t> add(const CoarseCubes& cubes, uint32_t levels);
  void clear() { nodes_.reset(); }

  const PartialDag& dag() const { return nodes_->dag; }
  const std::string& digest() const { return nodes_->digest; }

 private:
  struct Nodes {
    Nodes(uint32_t levels, std::string name) : dag(levels), digest(std::move(name)) {}
    PartialDag dag;
    const std::string digest;
    uint64_t max_words = 0;  // above this number of words a new DAG is built
  };
  const std::string job_;
  const uint64_t max_words_;
  std::unique_ptr<Nodes> nodes_;
};

// The current answers to requests. Thread-safe. Its lock is never held while the folder is read.
class PublishedAnswers {
 public:
  std::shared_ptr<const std::string> json() const;
  std::shared_ptr<const TileSource> tiles() const;
  // Returns the tiles that set_tiles() stored last, even after clear(), if they have this digest;
  // else null.
  std::shared_ptr<const TileSource> known(const std::string& digest) const;

  void set_json(std::string json);
  void set_tiles(std::shared_ptr<const TileSource> tiles);
  // Removes the answers. Returns true if known() still has tiles.
  bool clear();

 private:
  mutable std::mutex mutex_;  // guards the members below
  std::shared_ptr<const std::string> json_;
  std::shared_ptr<const TileSource> tiles_, known_;
};

class PartialView {
 public:
  PartialView(FileSystem& files, const std::string& job, uint64_t max_words)
      : files_(files), job_(job), nodes_(job, max_words) {}

  const std::string& job() const { return job_; }
  // json() and tiles() behave as documented in PartialViews.
  std::shared_ptr<const std::string> json(const JobFolder& folder, uint64_t resolution);
  std::shared_ptr<const TileSource> tiles(const JobFolder& folder, uint64_t resolution);
  std::shared_ptr<const TileSource> known(const std::string& digest) const {
    return answers_.known(digest);
  }
  // True if the last read found no work folder or no plan, and tiles() has never succeeded.
  // PartialViews then forgets this view, because it has nothing to serve.
  bool is_worthless() const { return is_worthless_; }

 private:
  // Returns an updated answer. If another thread is reading the folder, returns the previous
  // answer.
  template <class Answer, class Update>
  Answer read(const JobFolder& folder, Answer (PublishedAnswers::*answer)() const,
              const Update& update);
  void refresh(const JobFolder& folder);
  void read_cubes(const JobFolder& folder);
  void restart();
  void update_json(uint64_t resolution);
  void update_tiles(const JobFolder& folder, uint64_t resolution);
  void find_frame(const JobFolder& folder, uint64_t resolution);
  nlohmann::ordered_json make_manifest(const TileSource& tiles, std::optional<uint64_t> root) const;

  FileSystem& files_;
  const std::string job_;
  PublishedAnswers answers_;
  std::atomic<bool> is_worthless_{false};

  std::mutex reading_mutex_;  // held by the thread that reads the folder; guards the members below
  ReadLimiter limiter_;
  CoarseCubes cubes_;
  uint64_t version_ = 0;          // number of successful readings
  bool has_failed_ = false;       // true if the last read failed
  nlohmann::ordered_json frame_;  // the manifest's constant members; null before the plan exists
  GrowingDag nodes_;
  std::shared_ptr<const MergedLevels> merged_;  // null until the levels are merged
  // Values of version_ for which the list, the tiles and the frame were updated last.
  uint64_t json_version_ = 0, tiles_version_ = 0, frame_version_ = 0;
};

}  // namespace voxdag::server
