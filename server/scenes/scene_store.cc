#include "server/scenes/scene_store.h"

#include <algorithm>
#include <cstring>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/format/checksum.h"
#include "scene/formats/formats.h"
#include "server/base/request_error.h"
#include "server/disk/store.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxNameBytes = 128;

// In the table `upload`, `total` is -1 while the size of the scene is unknown. `sha256` is "" until
// publish() has recorded the digest of the complete upload.
constexpr const char* kSceneSchema = R"sql(
CREATE TABLE scene (
  name TEXT PRIMARY KEY, size INTEGER NOT NULL, sha256 TEXT NOT NULL, modified_s REAL NOT NULL
);
CREATE TABLE upload (
  name TEXT PRIMARY KEY, offset INTEGER NOT NULL, total INTEGER NOT NULL, sha256 TEXT NOT NULL,
  updated_s REAL NOT NULL
);
)sql";

std::string make_folders(FileSystem& files, const std::string& folder) {
  files.make_directories(folder + "/files");
  files.make_directories(folder + "/parts");
  return folder;
}

// Application id "vdsc": the scenes of a service.
const StoreFormat kSceneFormat = {"records of scenes", "scenes", 0x76647363, 0, kSceneSchema};

Scene scene_of_row(const SqlStatement& row) {
  return {row.text(0), true, row.word(1), row.word(1), row.text(2), row.real(3)};
}

}  // namespace

bool is_scene_name(std::string_view name) {
  const auto is_alphanumeric = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  };
  if (name.empty() || name.size() > kMaxNameBytes || !is_alphanumeric(name[0])) return false;
  for (const char c : name)
    if (!is_alphanumeric(c) && c != '.' && c != '_' && c != '-') return false;
  return has_scene_ending(name);
}

std::string scene_name_pattern() {
  size_t longest = 0;
  for (const SceneFormat& format : scene_formats())
    for (const std::string_view ending : format.endings) longest = std::max(longest, ending.size());
  std::string endings;
  for (const char c : list_scene_endings("|", "|")) {
    if (c >= 'a' && c <= 'z')
      endings.append({'[', static_cast<char>(c - 'a' + 'A'), c, ']'});
    else if (c != '.')
      endings += c;
  }
  return "^[A-Za-z0-9][A-Za-z0-9._-]{0," + std::to_string(kMaxNameBytes - 1 - longest) + "}\\.(" +
         endings + ")$";
}

std::string file_sha256(FileSystem& files, const std::string& path, uint64_t size,
                        const std::function<void()>& check) {
  constexpr uint64_t kPieceBytes = 256 << 10;
  const auto file = files.open_own(path);
  Sha256 digest;
  std::vector<std::byte> piece;
  for (uint64_t at = 0; at < size; at += piece.size()) {
    check();
    piece.resize(std::min(kPieceBytes, size - at));
    file->read_at(at, piece);
    digest.add(piece);
  }
  return digest.finish();
}

SceneStore::SceneStore(FileSystem& files, const std::string& folder, Log log, bool adopt)
    : files_(files),
      folder_(make_folders(files, folder)),
      log_(std::move(log)),
      database_(open_store(folder + "/scenes.db", kSceneFormat,
                           adopt || (!has_entries(files, folder + "/files") &&
                                     !has_entries(files, folder + "/parts")))),
      file_(folder + "/scenes.db") {
  finish_all_publishing();
  finish_removals();
  if (adopt) adopt_scenes();
}

void SceneStore::finish_all_publishing() {
  struct Finished {
    std::string name, sha256;
    uint64_t size;
  };
  std::vector<Finished> finished;
  auto rows = database_.prepare("SELECT name, sha256, offset FROM upload WHERE sha256 != ''");
  while (rows.step()) finished.push_back({rows.text(0), rows.text(1), rows.word(2)});
  rows.reset();
  for (const Finished& f : finished) {
    try {
      finish_publishing(f.name, f.size, f.sha256);
    } catch (const Error& error) {
      log_("scene " + f.name + ": failed to finish its upload: " + error.message());
      if (error.is_corruption()) drop_upload(f.name);  // the client must upload it again
    }
  }
}

void SceneStore::finish_removals() {
  for (const DirectoryEntry& entry : files_.list(folder_ + "/files")) {
    if (entry.is_directory || !entry.name.ends_with(kDeleted)) continue;
    const std::string name = entry.name.substr(0, entry.name.size() - strlen(kDeleted));
    if (!is_scene_name(name)) continue;
    try {
      const NameLock lock(*this, name);
      drop_scene(name);
      log_("scene " + name + ": finished a deletion that was interrupted");
    } catch (const RequestError&) {
      // The scene is being uploaded. The next call retries.
    } catch (const std::exception& error) {
      log_("scene " + name + ": failed to finish its deletion: " + error.what());
    }
  }
}

void SceneStore::adopt_scenes() {
  for (const DirectoryEntry& entry : files_.list(folder_ + "/files")) {
    if (entry.is_directory || !is_scene_name(entry.name)) continue;
    if (find(entry.name).value_or(Scene{}).complete) continue;
    put_scene(entry.name, entry.bytes, file_sha256(files_, path(entry.name), entry.bytes));
    log_("scene " + entry.name + " adopted");
  }
  for (const DirectoryEntry& entry : files_.list(folder_ + "/parts")) {
    if (entry.is_directory || !is_scene_name(entry.name) || upload(entry.name)) continue;
    record(entry.name, {});  // the number of synced bytes is unknown
    log_("scene " + entry.name + ": adopted its unfinished upload, which starts over");
  }
}

std::optional<Scene> SceneStore::find(const std::string& name) {
  std::lock_guard lock(mutex_);
  auto row = database_.prepare("SELECT name, size, sha256, modified_s FROM scene WHERE name = ?");
  if (row.bind(0, name).step()) return scene_of_row(row);
  auto part = database_.prepare("SELECT name, offset, total, updated_s FROM upload WHERE name = ?");
  if (!part.bind(0, name).step()) return {};
  Scene scene{name, false, {}, part.word(1), "", part.real(3)};
  if (part.integer(2) >= 0) scene.size = part.word(2);
  return scene;
}

std::vector<Scene> SceneStore::list(const std::string& after, size_t limit) {
  std::vector<std::string> names;
  {
    std::lock_guard lock(mutex_);
    auto rows = database_.prepare(
        "SELECT name FROM scene WHERE name > ?1 UNION SELECT name FROM upload WHERE name > ?1 "
        "ORDER BY name LIMIT ?2");
    rows.bind(0, after).bind(1, static_cast<int64_t>(limit));
    while (rows.step()) names.push_back(rows.text(0));
  }
  std::vector<Scene> scenes;
  for (const std::string& name : names)
    if (auto scene = find(name)) scenes.push_back(std::move(*scene));
  return scenes;
}

std::optional<UploadState> SceneStore::upload(const std::string& name) {
  std::lock_guard lock(mutex_);
  auto row = database_.prepare("SELECT offset, total FROM upload WHERE name = ?");
  if (!row.bind(0, name).step()) return {};
  UploadState state{row.word(0), {}};
  if (row.integer(1) >= 0) state.total = row.word(1);
  return state;
}

bool SceneStore::remove(const std::string& name) {
  const NameLock lock(*this, name);
  check_file();
  const bool found = find(name).has_value();
  if (files_.exists(path(name))) {
    files_.rename(path(name), marked_path(name));
    // Truncates the marked file. This frees the scene's space, so the database can then be written
    // even on a full disk.
    files_.create(marked_path(name))->close();
  }
  drop_upload(name);
  drop_scene(name);
  return found;
}

void SceneStore::drop_scene(const std::string& name) {
  check_file();
  if (!files_.exists(path(name))) {
    std::lock_guard lock(mutex_);
    SqlTransaction transaction(database_);
    database_.prepare("DELETE FROM scene WHERE name = ?").bind(0, name).run();
    transaction.commit();
  }
  if (files_.exists(marked_path(name))) files_.remove(marked_path(name));
}

double SceneStore::last_change_s() {
  std::lock_guard lock(mutex_);
  auto row = database_.prepare(
      "SELECT max(s) FROM (SELECT modified_s AS s FROM scene UNION ALL SELECT updated_s FROM "
      "upload)");
  return row.step() ? row.real(0) : 0;
}

void SceneStore::remove_stale_uploads(double before_s) {
  const auto stale = [&](const std::string& pattern) {
    std::lock_guard lock(mutex_);
    auto rows = database_.prepare("SELECT name FROM upload WHERE updated_s < ? AND name GLOB ?");
    rows.bind(0, before_s).bind(1, pattern);
    std::vector<std::string> names;
    while (rows.step()) names.push_back(rows.text(0));
    return names;
  };
  for (const std::string& name : stale("*")) {
    try {
      const NameLock lock(*this, name);
      if (stale(name).empty()) continue;  // a part has arrived since the first query
      check_file();
      drop_upload(name);
      log_("scene " + name +
           ": removed its unfinished upload, which has received nothing for too long");
    } catch (const RequestError&) {
      // The scene is being uploaded, so its upload is not stale.
    }
  }
}

SceneStore::NameLock::NameLock(SceneStore& store, const std::string& name)
    : store_(store), name_(name) {
  std::lock_guard lock(store_.mutex_);
  if (!store_.busy_.insert(name_).second)
    throw RequestError(RequestError::Kind::kConflict,
                       "another request is uploading or deleting the scene '" + name_ +
                           "': expected one such request for a scene at a time");
}

SceneStore::NameLock::~NameLock() {
  std::lock_guard lock(store_.mutex_);
  store_.busy_.erase(name_);
}

void SceneStore::record(const std::string& name, const UploadState& state) {
  check_file();
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  database_.prepare("INSERT OR REPLACE INTO upload VALUES (?, ?, ?, '', ?)")
      .bind(0, name)
      .bind_word(1, state.offset)
      .bind(2, state.total ? static_cast<int64_t>(*state.total) : int64_t{-1})
      .bind(3, unix_seconds())
      .run();
  transaction.commit();
}

void SceneStore::publish(const std::string& name, uint64_t size, const std::string& sha256) {
  check_file();
  check_part(name, size);
  {
    std::lock_guard lock(mutex_);
    SqlTransaction transaction(database_);
    database_.prepare("UPDATE upload SET sha256 = ?, offset = ? WHERE name = ?")
        .bind(0, sha256)
        .bind_word(1, size)
        .bind(2, name)
        .run();
    transaction.commit();
  }
  // The file marked as deleted is left from a failed deletion of an earlier scene with this name.
  if (files_.exists(marked_path(name))) files_.remove(marked_path(name));
  move_into_place(name, size, sha256);
}

void SceneStore::finish_publishing(const std::string& name, uint64_t size,
                                   const std::string& sha256) {
  const bool moved = !files_.exists(part_path(name)) && files_.exists(path(name));
  if (moved && file_sha256(files_, path(name), size) == sha256) {
    put_scene(name, size, sha256);
    return;
  }
  check_part(name, size);
  move_into_place(name, size, sha256);
}

void SceneStore::check_part(const std::string& name, uint64_t size) {
  if (!files_.exists(part_path(name)))
    throw Error(ErrorCode::kCorrupt, part_path(name) +
                                         ": the file was removed during the upload: expected it to "
                                         "remain; upload the scene again");
  const uint64_t found = files_.open_own(part_path(name))->size();
  if (found != size)
    throw Error(ErrorCode::kCorrupt, part_path(name) + " has " + std::to_string(found) +
                                         " bytes: expected " + std::to_string(size) +
                                         "; the file was changed during the upload");
}

void SceneStore::move_into_place(const std::string& name, uint64_t size,
                                 const std::string& sha256) {
  files_.rename(part_path(name), path(name));
  files_.sync_directory(folder_ + "/files");
  put_scene(name, size, sha256);
}

void SceneStore::put_scene(const std::string& name, uint64_t size, const std::string& sha256) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  database_.prepare("INSERT OR REPLACE INTO scene VALUES (?, ?, ?, ?)")
      .bind(0, name)
      .bind_word(1, size)
      .bind(2, sha256)
      .bind(3, unix_seconds())
      .run();
  database_.prepare("DELETE FROM upload WHERE name = ?").bind(0, name).run();
  transaction.commit();
}

// Removes an upload: first its file, which frees space on a full disk, then its record. If a crash
// leaves the record without its file, the upload starts over.
void SceneStore::drop_upload(const std::string& name) {
  if (files_.exists(part_path(name))) files_.remove(part_path(name));
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  database_.prepare("DELETE FROM upload WHERE name = ?").bind(0, name).run();
  transaction.commit();
}

}  // namespace voxdag::server
