#include "server/jobs/process/subvolume_map.h"

namespace voxdag::server {

void SubvolumeMap::set(uint64_t resolution, std::span<const SubvolumeStatus> all) {
  resolution_ = resolution;
  entries_.clear();
  totals_ = {};
  for (const SubvolumeStatus& subvolume : all) add(subvolume);
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
  const char* separator = "";
  for (const auto& [id, entry] : entries_) {
    text += separator;
    separator = ",";
    text += '[';
    for (const uint32_t position : entry.corner) text += std::to_string(position) + ',';
    text += std::to_string(entry.edge) + (entry.built ? ",1]" : ",0]");
  }
  return text + "]}";
}

}  // namespace voxdag::server
