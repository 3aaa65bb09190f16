#include <gtest/gtest.h>

#include <filesystem>

#include "core/db/sqlite.h"
#include "core/format/checksum.h"
#include "core/io/forwarding_files.h"
#include "server/base/request_error.h"
#include "server/disk/data_folder.h"
#include "server/scenes/scene_store.h"
#include "server/scenes/scene_upload.h"
#include "tests/support/temporary_folder.h"

namespace voxdag::server {
namespace {

// Calls before_removal() before the next removal of a file, and only once.
class RemovalHook : public ForwardingFiles {
 public:
  RemovalHook() : ForwardingFiles(system_files()) {}
  void remove(const std::string& path) override {
    if (before_removal) std::exchange(before_removal, nullptr)();
    ForwardingFiles::remove(path);
  }
  std::function<void()> before_removal;
};

class Scenes : public testing::Test {
 protected:
  void reopen() {
    store_.reset();
    store_ = make_store(false);
  }
  std::unique_ptr<SceneStore> make_store(bool adopt) {
    return std::make_unique<SceneStore>(
        files_, folder_.path(), [this](const LogEntry& entry) { log_ += entry.message + "\n"; },
        adopt);
  }
  std::optional<RequestError> refusal(const std::function<void()>& act) {
    try {
      act();
      return {};
    } catch (const RequestError& error) {
      return error;
    }
  }
  void put(const std::string& name, const std::string& bytes) {
    SceneUpload upload(*store_, name, 0, bytes.size());
    upload.write(bytes);
    upload.finish("", "", true);
    upload.publish();
  }
  std::string contents(const std::string& name) {
    return read_small_file(system_files(), store_->path(name), 1 << 20);
  }

  TemporaryFolder folder_;
  RemovalHook files_;
  std::string log_;
  std::unique_ptr<SceneStore> store_ = make_store(false);
};

TEST(SceneName, IsAPlainFileName) {
  EXPECT_TRUE(is_scene_name("a.glb"));
  EXPECT_TRUE(is_scene_name("Sponza_2-x.1.gltf"));
  EXPECT_TRUE(is_scene_name("PART.STL"));
  for (const char* name : {"", ".glb", "a", "a.doc", "../a.glb", "a/b.glb", "-a.glb", "a b.glb",
                           "a\0.glb", "ä.glb", "a.glb\n", "a.glb/"}) {
    SCOPED_TRACE(name);
    EXPECT_FALSE(is_scene_name(name));
  }
  EXPECT_FALSE(is_scene_name(std::string(125, 'a') + ".glb"));
}

TEST_F(Scenes, ArriveInOneGo) {
  {
    SceneUpload upload(*store_, "a.glb", 0, 5);
    upload.write("hel");
    upload.write("lo");
    EXPECT_FALSE(store_->find("a.glb")->complete);
    EXPECT_TRUE(upload.finish("", sha256_hex("hello"), true));
    EXPECT_EQ(upload.publish(), sha256_hex("hello"));
  }
  reopen();
  const auto scene = store_->find("a.glb");
  ASSERT_TRUE(scene && scene->complete);
  EXPECT_EQ(scene->size, 5u);
  EXPECT_EQ(scene->sha256, sha256_hex("hello"));
  EXPECT_EQ(contents("a.glb"), "hello");
  EXPECT_FALSE(store_->upload("a.glb"));
}

// If the connection of an upload breaks, the bytes that have arrived are kept, even after a restart
// of the service.
TEST_F(Scenes, ContinueWhereTheyBrokeOff) {
  {
    SceneUpload upload(*store_, "a.glb", 0, 10);
    upload.write("01234");
  }
  reopen();
  ASSERT_EQ(store_->upload("a.glb")->offset, 5u);
  EXPECT_EQ(store_->upload("a.glb")->total, 10u);
  const auto wrong = refusal([&] { SceneUpload(*store_, "a.glb", 4, 10); });
  ASSERT_TRUE(wrong);
  EXPECT_EQ(wrong->kind(), RequestError::Kind::kConflict);
  EXPECT_EQ(wrong->upload_offset, 5u);
  EXPECT_EQ(refusal([&] { SceneUpload(*store_, "a.glb", 5, 11); })->kind(),
            RequestError::Kind::kInvalid);
  SceneUpload upload(*store_, "a.glb", 5, 10);
  upload.write("56789");
  EXPECT_TRUE(upload.finish(sha256_hex("56789"), sha256_hex("0123456789"), true));
  EXPECT_EQ(upload.publish(), sha256_hex("0123456789"));
}

// After a crash, or while the connection hangs, the client sends at most the bytes of the last
// second again.
TEST_F(Scenes, AreRecordedEverySecond) {
  const auto offset = [&] { return store_->upload("a.glb")->offset; };
  double now = 0;
  SceneUpload upload(*store_, "a.glb", 0, 20, [&] { return now; });
  upload.write("0123");
  now = 0.9;
  upload.write("45");
  EXPECT_EQ(offset(), 0u);
  now = 1;
  upload.write("67");
  EXPECT_EQ(offset(), 8u);
  EXPECT_EQ(read_small_file(system_files(), folder_.file("parts/a.glb"), 100), "01234567");
  now = 1.9;
  upload.write("8");
  EXPECT_EQ(offset(), 8u);
  now = 2;
  upload.write("9");
  EXPECT_EQ(offset(), 10u);
}

// A wrong digest also discards the bytes of the part that are already recorded.
TEST_F(Scenes, DropRecordedBytesOfTheWrongDigest) {
  const auto send = [&](uint64_t first, const char* bytes, const char* digest) {
    double now = 0;
    SceneUpload upload(*store_, "a.glb", first, 10, [&] { return now += 2; });
    upload.write(bytes);
    EXPECT_EQ(store_->upload("a.glb")->offset, first + 5);
    return refusal([&] { upload.finish(sha256_hex(digest), "", false); });
  };
  EXPECT_FALSE(send(0, "01234", "01234"));
  EXPECT_TRUE(send(5, "x6789", "56789"));
  EXPECT_EQ(store_->upload("a.glb")->offset, 5u);
}

TEST_F(Scenes, DropAPartOfTheWrongDigest) {
  {
    SceneUpload upload(*store_, "a.glb", 0, 10);
    upload.write("01234");
    EXPECT_FALSE(upload.finish("", "", false));
  }
  {
    SceneUpload upload(*store_, "a.glb", 5, 10);
    upload.write("x6789");
    EXPECT_EQ(refusal([&] { upload.finish(sha256_hex("56789"), "", true); })->kind(),
              RequestError::Kind::kInvalid);
  }
  EXPECT_EQ(store_->upload("a.glb")->offset, 5u);
}

TEST_F(Scenes, DropAWholeOfTheWrongDigest) {
  {
    SceneUpload upload(*store_, "a.glb", 0, 5);
    upload.write("hello");
    EXPECT_EQ(refusal([&] { upload.finish("", sha256_hex("other"), true); })->kind(),
              RequestError::Kind::kInvalid);
  }
  EXPECT_FALSE(store_->find("a.glb"));
}

TEST_F(Scenes, AreWrittenByOneRequestAtATime) {
  SceneUpload upload(*store_, "a.glb", 0, 5);
  EXPECT_EQ(refusal([&] { SceneUpload(*store_, "a.glb", 0, 5); })->kind(),
            RequestError::Kind::kConflict);
  EXPECT_FALSE(refusal([&] { SceneUpload(*store_, "b.glb", 0, 5); }));
}

// The old scene is kept until the new one is complete.
TEST_F(Scenes, AreReplacedAtOnce) {
  put("a.glb", "old");
  SceneUpload upload(*store_, "a.glb", 0, 3);
  upload.write("new");
  EXPECT_EQ(contents("a.glb"), "old");
  EXPECT_TRUE(store_->find("a.glb")->complete);
  upload.finish("", "", true);
  upload.publish();
  EXPECT_EQ(contents("a.glb"), "new");
}

TEST_F(Scenes, AreListedByNameAndRemoved) {
  for (const char* name : {"b.glb", "a.glb", "c.glb"}) put(name, "x");
  auto page = store_->list("", 2);
  ASSERT_EQ(page.size(), 2u);
  EXPECT_EQ(page[1].name, "b.glb");
  EXPECT_EQ(store_->list("b.glb", 5).at(0).name, "c.glb");
  EXPECT_TRUE(store_->remove("a.glb"));
  EXPECT_FALSE(store_->remove("a.glb"));
  EXPECT_FALSE(store_->find("a.glb"));
}

// A scene cannot be removed while an upload of it is in progress.
TEST_F(Scenes, AreNotRemovedWhileTheyArrive) {
  SceneUpload upload(*store_, "a.glb", 0, 5);
  upload.write("hel");
  EXPECT_EQ(refusal([&] { store_->remove("a.glb"); })->kind(), RequestError::Kind::kConflict);
  upload.write("lo");
  EXPECT_TRUE(upload.finish("", "", true));
  upload.publish();
  EXPECT_EQ(contents("a.glb"), "hello");
}

TEST_F(Scenes, AreNotCompleteWithoutTheirBytes) {
  const std::string part = folder_.file("parts/a.glb");
  {
    SceneUpload upload(*store_, "a.glb", 0, 5);
    upload.write("hello");
    EXPECT_TRUE(upload.finish("", "", true));
    system_files().remove(part);
    EXPECT_THROW(upload.publish(), Error);
  }
  EXPECT_FALSE(store_->find("a.glb"));
  {
    SceneUpload upload(*store_, "a.glb", 0, 5);
    upload.write("hello");
    EXPECT_TRUE(upload.finish("", "", true));
    write_file_atomically(system_files(), part, "he");
    EXPECT_THROW(upload.publish(), Error);
  }
  EXPECT_FALSE(store_->find("a.glb"));
  // The service crashed after it had recorded the digest of a complete upload. The scene exists
  // after the restart only if its file is complete: not if the file is missing or has other bytes.
  for (const char* left : {"", "hello", "hallo"}) {
    SCOPED_TRACE(left);
    { SceneUpload(*store_, "a.glb", 0, 5).write("hello"); }
    system_files().remove(part);
    if (*left) write_file_atomically(system_files(), store_->path("a.glb"), left);
    SqlDatabase(folder_.file("scenes.db"), SqlDatabase::Mode::kReadWrite)
        .execute("UPDATE upload SET sha256 = '" + sha256_hex("hello") + "'");
    reopen();
    EXPECT_EQ(store_->find("a.glb").has_value(), std::string_view(left) == "hello");
    store_->remove("a.glb");
    if (*left && system_files().exists(store_->path("a.glb")))
      system_files().remove(store_->path("a.glb"));
  }
}

// If the partial file of an upload is missing, or is shorter than recorded, the upload starts over.
TEST_F(Scenes, StartOverIfTheirBytesAreLost) {
  const std::string part = folder_.file("parts/a.glb");
  for (const char* left : {"", "0123"}) {
    SCOPED_TRACE(left);
    { SceneUpload(*store_, "a.glb", 0, 10).write("01234"); }
    system_files().remove(part);
    if (*left) write_file_atomically(system_files(), part, left);
    const auto lost = refusal([&] { SceneUpload(*store_, "a.glb", 5, 10); });
    ASSERT_TRUE(lost);
    EXPECT_EQ(lost->kind(), RequestError::Kind::kConflict);
    EXPECT_EQ(lost->upload_offset, 0u);
    EXPECT_FALSE(store_->upload("a.glb"));
  }
  SceneUpload upload(*store_, "a.glb", 0, 2);
  upload.write("ok");
  EXPECT_TRUE(upload.finish("", "", true));
  upload.publish();
  EXPECT_EQ(contents("a.glb"), "ok");
}

// If the database is lost, the store does not start unless it may adopt the existing scenes. It
// keeps files that no upload created.
TEST_F(Scenes, StayWithoutTheirDatabase) {
  put("a.glb", "hello");
  store_.reset();
  for (const char* suffix : {"", "-wal", "-shm"})
    std::filesystem::remove(folder_.file("scenes.db") + suffix);
  write_file_atomically(system_files(), folder_.file("files/README"), "x");
  for (const char* name : {"parts/b.glb", "parts/README"})
    write_file_atomically(system_files(), folder_.file(name), "x");
  for (int i = 0; i < 2; ++i) EXPECT_THROW(make_store(false), Error) << "and made no database";
  store_ = make_store(true);
  const auto scene = store_->find("a.glb");
  ASSERT_TRUE(scene && scene->complete);
  EXPECT_EQ(scene->sha256, sha256_hex("hello"));
  EXPECT_EQ(scene->size, 5u);
  EXPECT_EQ(store_->list("", 10).size(), 2u);
  EXPECT_NE(log_.find("a.glb adopted"), std::string::npos) << log_;
  EXPECT_NE(log_.find("b.glb: adopted"), std::string::npos) << log_;
  // An adopted partial file has the offset 0, because it is unknown how many of its bytes are
  // durable. A client must start over, or the file is removed later.
  const auto part = store_->upload("b.glb");
  ASSERT_TRUE(part);
  EXPECT_EQ(part->offset, 0u);
  reopen();
  store_->remove_stale_uploads(1e12);
  EXPECT_FALSE(store_->find("b.glb"));
  EXPECT_FALSE(system_files().exists(folder_.file("parts/b.glb")));
  for (const char* name : {"files/README", "parts/README"})
    EXPECT_TRUE(system_files().exists(folder_.file(name))) << name;
}

// If a crash interrupted the removal of a scene, the next start finishes it.
TEST_F(Scenes, AreRemovedInTheEnd) {
  put("a.glb", "hello");
  system_files().rename(store_->path("a.glb"), store_->path("a.glb") + kDeleted);
  reopen();
  EXPECT_FALSE(store_->find("a.glb"));
  EXPECT_FALSE(has_entries(system_files(), folder_.file("files")));
}

// A deletion renames the scene's file to mark it. If the deletion then fails, only the marked file
// is removed later, not a new scene with the same name.
TEST_F(Scenes, AreNotRemovedByAnEarlierDeletion) {
  put("a.glb", "old");
  const std::string marked = store_->path("a.glb") + kDeleted;
  {
    SqlDatabase outside(folder_.file("scenes.db"), SqlDatabase::Mode::kReadWrite);
    const SqlTransaction locked(outside);
    EXPECT_THROW(store_->remove("a.glb"), Error);
  }
  EXPECT_TRUE(system_files().exists(marked));
  put("a.glb", "new");
  EXPECT_FALSE(system_files().exists(marked));
  for (const bool at_start : {false, true}) {
    SCOPED_TRACE(at_start);
    system_files().create(marked)->close();  // as if the upload had not removed this file
    at_start ? reopen() : store_->finish_removals();
    EXPECT_FALSE(system_files().exists(marked));
    ASSERT_TRUE(store_->find("a.glb"));
    EXPECT_EQ(contents("a.glb"), "new");
  }
}

// An interrupted deletion of a scene does not remove a later unfinished upload.
TEST_F(Scenes, KeepAnUploadFromAnEarlierDeletion) {
  put("a.glb", "old");
  { SceneUpload(*store_, "a.glb", 0, 10).write("01234"); }
  system_files().rename(store_->path("a.glb"), store_->path("a.glb") + kDeleted);
  reopen();
  EXPECT_EQ(store_->upload("a.glb")->offset, 5u);
  EXPECT_FALSE(store_->find("a.glb")->complete);
  EXPECT_NE(log_.find("scene a.glb: finished a deletion"), std::string::npos) << log_;
}

// When the store starts, it logs each upload that it drops because it cannot finish it.
TEST_F(Scenes, AreNotDroppedSilently) {
  { SceneUpload(*store_, "a.glb", 0, 5).write("hello"); }
  system_files().remove(folder_.file("parts/a.glb"));
  SqlDatabase(folder_.file("scenes.db"), SqlDatabase::Mode::kReadWrite)
      .execute("UPDATE upload SET sha256 = 'x'");
  reopen();
  EXPECT_FALSE(store_->find("a.glb"));
  EXPECT_NE(log_.find("scene a.glb: failed to finish its upload"), std::string::npos) << log_;
}

// All bytes of a scene have arrived, but publish() was not called, because the service stopped or
// the client disconnected. An upload of an empty part completes the scene.
TEST_F(Scenes, AreFinishedByAnEmptyPart) {
  for (const std::optional<uint64_t> total : {std::optional<uint64_t>(5), {}}) {
    for (const bool stopped : {false, true}) {
      {
        SceneUpload upload(*store_, "a.glb", 0, total);
        upload.write("hel");
        upload.finish("", "", false);
      }
      {
        SceneUpload upload(*store_, "a.glb", 3, total);
        upload.write("lo");
        const auto check = [&] {
          if (stopped) throw std::runtime_error("stopped");
        };
        if (stopped)
          EXPECT_THROW(upload.finish("", "", true, check), std::runtime_error);
        else
          EXPECT_TRUE(upload.finish("", "", true, check));
      }
      reopen();
      ASSERT_EQ(store_->upload("a.glb")->offset, 5u);
      EXPECT_EQ(refusal([&] { SceneUpload(*store_, "a.glb", 6, 6); })->upload_offset, 5u);
      SceneUpload upload(*store_, "a.glb", 5, 5);
      EXPECT_TRUE(upload.finish("", sha256_hex("hello"), true));
      upload.publish();
      EXPECT_EQ(contents("a.glb"), "hello");
    }
  }
}

// If the file of the database is removed while the service runs, each call that must record
// something fails, and no scene changes.
TEST_F(Scenes, AreNotRecordedInADatabaseThatIsGone) {
  put("b.glb", "old");
  { SceneUpload(*store_, "old.glb", 0, 5).write("x"); }
  SceneUpload upload(*store_, "a.glb", 0, 5);
  upload.write("hello");
  EXPECT_TRUE(upload.finish("", "", true));
  for (const char* suffix : {"", "-wal", "-shm"})
    std::filesystem::remove(folder_.file("scenes.db") + suffix);
  EXPECT_THROW(upload.publish(), Error);
  EXPECT_FALSE(system_files().exists(store_->path("a.glb")));
  EXPECT_THROW(SceneUpload(*store_, "c.glb", 0, 5), Error);
  EXPECT_THROW(store_->remove("b.glb"), Error);
  EXPECT_THROW(store_->remove_stale_uploads(1e12), Error);
  EXPECT_EQ(contents("b.glb"), "old");
}

// An upload that ends before its first byte leaves neither a record nor a file.
TEST_F(Scenes, LeaveNothingWithoutABeginning) {
  { SceneUpload(*store_, "a.glb", 0, 5); }
  EXPECT_FALSE(store_->find("a.glb"));
  EXPECT_FALSE(system_files().exists(folder_.file("parts/a.glb")));
}

// If a client continues an old upload while old uploads are being removed, this upload is kept.
TEST_F(Scenes, AreNotStaleOnceTheyGoOn) {
  for (const char* name : {"a.glb", "b.glb"}) SceneUpload(*store_, name, 0, 5).write("he");
  SqlDatabase(folder_.file("scenes.db"), SqlDatabase::Mode::kReadWrite)
      .execute("UPDATE upload SET updated_s = 1000");
  files_.before_removal = [&] { SceneUpload(*store_, "b.glb", 2, 5).write("ll"); };
  store_->remove_stale_uploads(2000);
  EXPECT_FALSE(store_->upload("a.glb"));
  ASSERT_TRUE(store_->upload("b.glb"));
  EXPECT_EQ(store_->upload("b.glb")->offset, 4u);
  EXPECT_NE(log_.find("a.glb: removed its unfinished upload"), std::string::npos) << log_;
}

TEST_F(Scenes, DropStaleUploads) {
  { SceneUpload(*store_, "a.glb", 0, 5).write("abc"); }
  store_->remove_stale_uploads(0);
  EXPECT_TRUE(store_->upload("a.glb"));
  store_->remove_stale_uploads(1e12);
  EXPECT_FALSE(store_->upload("a.glb"));
  EXPECT_FALSE(system_files().exists(folder_.file("parts/a.glb")));
}

}  // namespace
}  // namespace voxdag::server
