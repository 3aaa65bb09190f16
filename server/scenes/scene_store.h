// Uploaded scenes: complete scenes in files/NAME, unfinished uploads in parts/NAME, and a record of
// each in scenes.db. Invariants:
//
//   1. A scene is complete only when all its bytes are synced and have the client's digest.
//   2. The recorded offset of an upload counts only synced bytes. After a power cut, the client
//      continues from this offset.
//   3. Only one request writes to an upload.
//   4. A deletion first marks the scene's file by renaming it, then removes only the marked file.
//      So it does not remove a newer upload of the same name.
//   5. Nothing is recorded in a database file that was removed or replaced.
//
// Thread-safe. Callers check names with is_scene_name().
#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/db/sqlite.h"
#include "core/io/file_system.h"
#include "server/base/steps.h"
#include "server/disk/data_folder.h"

namespace voxdag::server {

// True for a name of 1 to 128 characters A–Z a–z 0–9 . _ - that begins with a letter or digit and
// ends with a file name ending of a scene format.
bool is_scene_name(std::string_view name);
// Returns a regular expression that matches scene names, for the OpenAPI document.
std::string scene_name_pattern();

struct Scene {
  std::string name;
  bool complete = false;
  std::optional<uint64_t> size;  // size of the complete scene; nullopt while unknown
  uint64_t offset = 0;           // bytes received
  std::string sha256;            // hex digits; "" while the scene is incomplete
  double modified_s = 0;         // Unix time
};

struct UploadState {
  uint64_t offset = 0;
  std::optional<uint64_t> total;
};

class SceneStore {
 public:
  // Finishes operations interrupted by a crash. Throws Error{kInvalidInput} if there are scenes
  // without records and `adopt` is false. With `adopt`, they get new records, and unfinished
  // uploads start over.
  SceneStore(FileSystem& files, const std::string& folder, Log log, bool adopt = false);

  std::optional<Scene> find(const std::string& name);
  // Returns the first scenes whose names follow `after`, sorted by name.
  std::vector<Scene> list(const std::string& after, size_t limit);
  // Returns the state of an unfinished upload.
  std::optional<UploadState> upload(const std::string& name);
  // Removes a scene and its unfinished upload. Removes the files first, so that the call frees
  // space on a full disk. Returns false if the name has neither a scene nor an upload. Throws
  // RequestError{kConflict} if the scene is being uploaded.
  bool remove(const std::string& name);
  // Finishes removals that a crash or a full disk interrupted.
  void finish_removals();
  // Returns the Unix time of the newest record; 0 without records.
  double last_change_s();
  // Removes unfinished uploads that have received no bytes since `before_s` (Unix time).
  void remove_stale_uploads(double before_s);
  std::string path(const std::string& name) const { return folder_ + "/files/" + name; }
  // Throws Error{kIo} if the database was removed or replaced.
  void check_file() const { file_.check(); }

 private:
  friend class SceneUpload;

  // The exclusive permission to write to a scene name, during the lifetime of this object.
  class NameLock {
   public:
    // Throws RequestError{kConflict} if another request has the permission.
    NameLock(SceneStore& store, const std::string& name);
    ~NameLock();
    NameLock(const NameLock&) = delete;

   private:
    SceneStore& store_;
    const std::string name_;
  };

  std::string part_path(const std::string& name) const { return folder_ + "/parts/" + name; }
  std::string marked_path(const std::string& name) const { return path(name) + kDeleted; }
  void record(const std::string& name, const UploadState& state);
  // Records the digest of a finished upload, then renames the upload's file to its final path.
  void publish(const std::string& name, uint64_t size, const std::string& sha256);
  // Finishes an interrupted publish() call. Throws Error{kCorrupt} if bytes of the scene are
  // missing.
  void finish_publishing(const std::string& name, uint64_t size, const std::string& sha256);
  void check_part(const std::string& name, uint64_t size);
  void move_into_place(const std::string& name, uint64_t size, const std::string& sha256);
  void drop_upload(const std::string& name);
  // Removes the files marked as deleted, and the record of the scene unless it was uploaded again.
  void drop_scene(const std::string& name);
  void put_scene(const std::string& name, uint64_t size, const std::string& sha256);
  void finish_all_publishing();
  void adopt_scenes();

  FileSystem& files_;
  const std::string folder_;
  const Log log_;
  std::mutex mutex_;  // guards all members below
  SqlDatabase database_;
  const NamedFile file_;
  std::set<std::string> busy_;  // names that requests are writing to
};

// Returns the SHA-256 of the first `size` bytes of a file. Calls `check` often, so that `check` can
// stop the calculation by throwing.
std::string file_sha256(
    FileSystem& files, const std::string& path, uint64_t size,
    const std::function<void()>& check = [] {});

}  // namespace voxdag::server
