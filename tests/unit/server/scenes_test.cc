#include <gtest/gtest.h>

#include <filesystem>

#include "core/db/sqlite.h"
#include "core/format/checksum.h"
#include "server/data_folder.h"
#include "server/request_error.h"
#include "server/scenes/scene_store.h"
#include "server/scenes/scene_upload.h"
#include "tests/unit/io/temporary_folder.h"

namespace voxdag::server {
namespace {

class Scenes : public testing::Test {
 protected:
  void reopen() {
    store_.reset();
    store_ = std::make_unique<SceneStore>(system_files(), folder_.path());
  }
  std::optional<RequestError> refusal(const std::function<void()>& act) {
    try {
      act();
      return {};
    } catch (const RequestError& error) {
      return error;
    }
  }
  std::string contents(const std::string& name) {
    return read_small_file(system_files(), store_->path(name), 1 << 20);
  }

  TemporaryFolder folder_;
  std::unique_ptr<SceneStore> store_ = std::make_unique<SceneStore>(system_files(), folder_.path());
};

TEST(SceneName, IsAPlainFileName) {
  EXPECT_TRUE(is_scene_name("a.glb"));
  EXPECT_TRUE(is_scene_name("Sponza_2-x.1.gltf"));
  for (const char* name : {"", ".glb", "a", "a.obj", "../a.glb", "a/b.glb", "-a.glb", "a b.glb",
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

// What arrived before the connection broke is not lost, even if the service restarts.
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

// The old scene stays until the new one is complete.
TEST_F(Scenes, AreReplacedAtOnce) {
  {
    SceneUpload upload(*store_, "a.glb", 0, 3);
    upload.write("old");
    upload.finish("", "", true);
    upload.publish();
  }
  SceneUpload upload(*store_, "a.glb", 0, 3);
  upload.write("new");
  EXPECT_EQ(contents("a.glb"), "old");
  EXPECT_TRUE(store_->find("a.glb")->complete);
  upload.finish("", "", true);
  upload.publish();
  EXPECT_EQ(contents("a.glb"), "new");
}

TEST_F(Scenes, AreListedByNameAndRemoved) {
  for (const char* name : {"b.glb", "a.glb", "c.glb"}) {
    SceneUpload upload(*store_, name, 0, 1);
    upload.write("x");
    upload.finish("", "", true);
    upload.publish();
  }
  auto page = store_->list("", 2);
  ASSERT_EQ(page.size(), 2u);
  EXPECT_EQ(page[1].name, "b.glb");
  EXPECT_EQ(store_->list("b.glb", 5).at(0).name, "c.glb");
  EXPECT_TRUE(store_->remove("a.glb"));
  EXPECT_FALSE(store_->remove("a.glb"));
  EXPECT_FALSE(store_->find("a.glb"));
}

// Neither the bytes that arrive nor the record of them may disappear under a request.
TEST_F(Scenes, HardeningH3_AreNotRemovedWhileTheyArrive) {
  SceneUpload upload(*store_, "a.glb", 0, 5);
  upload.write("hel");
  EXPECT_EQ(refusal([&] { store_->remove("a.glb"); })->kind(), RequestError::Kind::kConflict);
  upload.write("lo");
  EXPECT_TRUE(upload.finish("", "", true));
  upload.publish();
  EXPECT_EQ(contents("a.glb"), "hello");
}

TEST_F(Scenes, HardeningH3_AreNotCompleteWithoutTheirBytes) {
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
  // A crash after the digest was recorded.
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

// The file of an upload that was lost, or is shorter than what is recorded, is sent again.
TEST_F(Scenes, HardeningH4_StartOverIfTheirBytesAreLost) {
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

// A database that is gone costs no scene, and files that no upload made are left alone.
TEST_F(Scenes, HardeningH2_StayWithoutTheirDatabase) {
  {
    SceneUpload upload(*store_, "a.glb", 0, 5);
    upload.write("hello");
    upload.finish("", "", true);
    upload.publish();
  }
  store_.reset();
  for (const char* suffix : {"", "-wal", "-shm"})
    std::filesystem::remove(folder_.file("scenes.db") + suffix);
  write_file_atomically(system_files(), folder_.file("files/README"), "x");
  write_file_atomically(system_files(), folder_.file("parts/b.glb"), "x");
  for (int i = 0; i < 2; ++i)
    EXPECT_THROW(SceneStore(system_files(), folder_.path()), Error) << "and made no database";
  store_ = std::make_unique<SceneStore>(system_files(), folder_.path(), true);
  const auto scene = store_->find("a.glb");
  ASSERT_TRUE(scene && scene->complete);
  EXPECT_EQ(scene->sha256, sha256_hex("hello"));
  EXPECT_EQ(scene->size, 5u);
  EXPECT_EQ(store_->list("", 10).size(), 1u);
  reopen();
  store_->remove_stale_uploads(1e12);
  EXPECT_TRUE(system_files().exists(folder_.file("files/README")));
  EXPECT_TRUE(system_files().exists(folder_.file("parts/b.glb")));
}

// A crash in the middle of a removal: the next start finishes it.
TEST_F(Scenes, AreRemovedInTheEnd) {
  {
    SceneUpload upload(*store_, "a.glb", 0, 5);
    upload.write("hello");
    upload.finish("", "", true);
    upload.publish();
  }
  system_files().rename(store_->path("a.glb"), store_->path("a.glb") + kDeleted);
  reopen();
  EXPECT_FALSE(store_->find("a.glb"));
  EXPECT_FALSE(has_entries(system_files(), folder_.file("files")));
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
