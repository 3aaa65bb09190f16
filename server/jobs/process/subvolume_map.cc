#include "server/jobs/process/subvolume_map.h"

#include "core/base/text.h"

namespace voxdag::server {

void SubvolumeMap::set(uint64_t resolution, std::span<const SubvolumeStatus> all) {
  resolution_ = resolution;
  entries_.clear();
  totals_ = {};
  for (const SubvolumeStatus& subvolume : all) add(subvolume);
}

void SubvolumeMap::set_grid(const std::array<double, 3>& origin, double edge) {
  origin_ = origin;
  edge_ = edge;
}

void SubvolumeMap::begun(int64_t id) {
  const auto entry = entries_.find(id);
  if (entry != entries_.end()) entry->second.begun = true;
}

void SubvolumeMap::stop() {
  for (auto& [id, entry] : entries_) entry.begun = false;
}

void SubvolumeMap::built(const SubvolumeStatus& subvolume) {
  const auto entry = entries_.find(subvolume.id);
  if (entry == entries_.end() || entry->second.built) return;
  entry->second.built = true;
  ++totals_.built;
  totals_.voxels += subvolume.voxels;
  totals_.nodes += subvolume.nodes;
  totals_.bytes += subvolume.bytes;
}

void SubvolumeMap::split(int64_t id, std::span<const SubvolumeStatus> parts) {
  totals_.total -= entries_.erase(id);
  for (const SubvolumeStatus& part : parts) add(part);
}

void SubvolumeMap::add(const SubvolumeStatus& subvolume) {
  Entry& entry = entries_[subvolume.id];
  for (int a = 0; a < 3; ++a) entry.corner[a] = static_cast<uint32_t>(subvolume.corner[a]);
  entry.edge = static_cast<uint32_t>(subvolume.edge);
  ++totals_.total;
  if (subvolume.built) built(subvolume);
}

std::string SubvolumeMap::json() const {
  std::string text = "{\"resolution\":" + std::to_string(resolution_) +
                     ",\"built\":" + std::to_string(totals_.built) +
                     ",\"total\":" + std::to_string(totals_.total) + ",\"cubes\":[";
  std::string working;
  for (const auto& [id, entry] : entries_) {
    std::string cube = "[";
    for (const uint32_t position : entry.corner) cube += std::to_string(position) + ',';
    cube += std::to_string(entry.edge);
    if (entry.begun && !entry.built) working += (working.empty() ? "" : ",") + cube + ']';
    text += (text.back() == '[' ? "" : ",") + cube + (entry.built ? ",1]" : ",0]");
  }
  text += "],\"working\":[" + working + "],\"origin\":[";
  for (const double c : origin_) text += (text.back() == '[' ? "" : ",") + number_text(c);
  return text + "],\"edge\":" + number_text(edge_) + "}";
}

}  // namespace voxdag::server
