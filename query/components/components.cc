#include "query/components/components.h"

#include <array>
#include <list>
#include <memory>
#include <unordered_map>
#include <utility>

#include "core/base/host_device.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "query/dag/dag_input.h"

namespace voxdag::query {
namespace {

constexpr const char* kWhat = "faces of cubes";

class ComponentSearch {
 public:
  ComponentSearch(const voxdag_reader::File& file, const ComponentRule& rule, MemoryBudget& budget,
                  Progress& progress, const CancelToken& cancel)
      : input_(file, budget.limit(), cancel),
        rule_(rule),
        budget_(budget),
        progress_(progress),
        cancel_(cancel),
        nodes_(file.brick_level() + 1) {}

  ComponentsReport run() {
    CubeComponents all = find(0, 0)->cube;
    close_all(all, rule_);
    return {all.closed, std::move(all.largest)};
  }

 private:
  // The components of a node, and the memory that they take. `voxels` is the number of its voxels.
  struct Result {
    CubeComponents cube;
    uint64_t voxels = 0;
    MemoryCharge charge;
  };
  using SharedResult = std::shared_ptr<const Result>;
  struct Kept {
    uint32_t level;
    uint64_t offset;
    SharedResult result;
  };
  // Approximate memory of a Result and of its places in kept_ and nodes_.
  static constexpr uint64_t kResultBytes = sizeof(Result) + sizeof(Kept) + 128;

  // Returns the components of a node or a brick, by its word offset.
  SharedResult find(uint32_t level, uint64_t offset) {
    auto& known = nodes_[level];
    if (const auto found = known.find(offset); found != known.end()) {
      kept_.splice(kept_.begin(), kept_, found->second);
      progress_.advance(found->second->result->voxels);
      return found->second->result;
    }
    SharedResult made =
        level == input_.file().brick_level() ? make_brick(offset) : make_node(level, offset);
    kept_.push_front({level, offset, made});
    known[offset] = kept_.begin();
    return made;
  }
  SharedResult make_brick(uint64_t offset) {
    const uint64_t mask = input_.brick(offset);
    auto result = std::make_shared<Result>();
    result->cube = components_of_brick(mask, rule_);
    result->voxels = static_cast<uint64_t>(popcount64(mask));
    progress_.advance(result->voxels);
    return charged(std::move(result));
  }
  SharedResult make_node(uint32_t level, uint64_t offset) {
    const auto offsets = children_by_index(input_.node(level, offset));
    std::array<SharedResult, 8> children;
    std::array<const CubeComponents*, 8> cubes = {};
    auto result = std::make_shared<Result>();
    uint64_t bytes = 0;
    for (size_t i = 0; i < 8; ++i) {
      if (offsets[i] == kNoNode) continue;
      children[i] = find(level + 1, offsets[i]);
      cubes[i] = &children[i]->cube;
      result->voxels += children[i]->voxels;
      bytes += children[i]->charge.bytes();
    }
    cancel_.check();
    // An estimate of the memory of the compared planes, the sets of labels, and the result.
    const MemoryCharge joining = charge(3 * bytes);
    const auto edge = static_cast<uint32_t>(input_.file().resolution() >> (level + 1));
    result->cube = join_components(cubes, edge, rule_);
    return charged(std::move(result));
  }
  SharedResult charged(std::shared_ptr<Result> result) {
    for (auto& face : result->cube.faces) face.shrink_to_fit();
    result->charge = charge(kResultBytes + result->cube.bytes());
    return result;
  }
  // Charges bytes to the budget. Drops results until they fit.
  MemoryCharge charge(uint64_t bytes) {
    while (budget_.available() < bytes && !kept_.empty()) {
      nodes_[kept_.back().level].erase(kept_.back().offset);
      kept_.pop_back();
    }
    return MemoryCharge(budget_, bytes, kWhat);
  }

  DagInput input_;
  const ComponentRule rule_;
  MemoryBudget& budget_;
  Progress& progress_;
  const CancelToken& cancel_;
  std::list<Kept> kept_;  // the results that were used last come first
  // For each level: the results of nodes by their word offset.
  std::vector<std::unordered_map<uint64_t, std::list<Kept>::iterator>> nodes_;
};

}  // namespace

ComponentsReport find_components(const voxdag_reader::File& file, const ComponentRule& rule,
                                 MemoryBudget& budget, Progress& progress,
                                 const CancelToken& cancel) {
  if (file.empty()) return {};
  const WatchedFile watched(file);
  return watched.run([&] {
    progress.begin_stage("components", file.voxels(), "voxels");
    ComponentsReport report = with_reader_errors(
        [&] { return ComponentSearch(file, rule, budget, progress, cancel).run(); });
    watched.check_readable();
    progress.end_stage();
    return report;
  });
}

}  // namespace voxdag::query
