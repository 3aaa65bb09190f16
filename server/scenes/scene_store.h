// Uploaded scenes: whole ones under files/NAME, those that are still arriving under parts/NAME, and
// what is known of both in scenes.db.
//
//   1. A scene is listed only when its bytes are whole, synced and of the digest that was promised.
//   2. The offset of an upload counts synced bytes only: a power cut loses what came after, and the
//      client is told so.
//   3. One request at a time writes to an upload.
// Thread-safe. Names are checked by is_scene_name() before they come here.
#pragma once

#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/db/sqlite.h"
#include "core/io/file_system.h"

namespace voxdag::server {

// 1 to 128 of A–Z a–z 0–9 . _ -, first a letter or digit, last ".glb" or ".gltf".
bool is_scene_name(std::string_view name);

struct Scene {
  std::string name;
  bool complete = false;
  std::optional<uint64_t> size;  // of the whole
  uint64_t offset = 0;           // how much is here
  std::string sha256;            // of complete ones
  double modified_s = 0;
};

struct UploadState {
  uint64_t offset = 0;
  std::optional<uint64_t> total;
};

class SceneStore {
 public:
  // Finishes what a crash interrupted.
  SceneStore(FileSystem& files, const std::string& folder);

  std::optional<Scene> find(const std::string& name);
  // In the order of names, after `after`.
  std::vector<Scene> list(const std::string& after, size_t limit);
  // Of a scene that is arriving.
  std::optional<UploadState> upload(const std::string& name);
  // Scene and upload. False if there is neither.
  bool remove(const std::string& name);
  // Uploads that nothing was added to since.
  void remove_stale_uploads(double before_s);
  std::string path(const std::string& name) const { return folder_ + "/files/" + name; }

 private:
  friend class Upload;

  std::string part_path(const std::string& name) const { return folder_ + "/parts/" + name; }
  bool lock_name(const std::string& name);
  void unlock_name(const std::string& name);
  void record(const std::string& name, const UploadState& state);
  // Names the digest of a whole upload, then gives it its place.
  void publish(const std::string& name, uint64_t size, const std::string& sha256);
  void finish_publishing(const std::string& name, uint64_t size, const std::string& sha256);
  void drop_upload(const std::string& name);

  FileSystem& files_;
  const std::string folder_;
  std::mutex mutex_;  // guards all below
  SqlDatabase database_;
  std::set<std::string> busy_;  // names that a request writes to
};

}  // namespace voxdag::server
