#include <gtest/gtest.h>

#include "core/format/checksum.h"
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
    Upload upload(*store_, "a.glb", 0, 5);
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
    Upload upload(*store_, "a.glb", 0, 10);
    upload.write("01234");
  }
  reopen();
  ASSERT_EQ(store_->upload("a.glb")->offset, 5u);
  EXPECT_EQ(store_->upload("a.glb")->total, 10u);
  const auto wrong = refusal([&] { Upload(*store_, "a.glb", 4, 10); });
  ASSERT_TRUE(wrong);
  EXPECT_EQ(wrong->kind(), RequestError::Kind::kConflict);
  EXPECT_EQ(wrong->upload_offset, 5u);
  EXPECT_EQ(refusal([&] { Upload(*store_, "a.glb", 5, 11); })->kind(),
            RequestError::Kind::kInvalid);
  Upload upload(*store_, "a.glb", 5, 10);
  upload.write("56789");
  EXPECT_TRUE(upload.finish(sha256_hex("56789"), sha256_hex("0123456789"), true));
  EXPECT_EQ(upload.publish(), sha256_hex("0123456789"));
}

TEST_F(Scenes, DropAPartOfTheWrongDigest) {
  {
    Upload upload(*store_, "a.glb", 0, 10);
    upload.write("01234");
    EXPECT_FALSE(upload.finish("", "", false));
  }
  {
    Upload upload(*store_, "a.glb", 5, 10);
    upload.write("x6789");
    EXPECT_EQ(refusal([&] { upload.finish(sha256_hex("56789"), "", true); })->kind(),
              RequestError::Kind::kInvalid);
  }
  EXPECT_EQ(store_->upload("a.glb")->offset, 5u);
}

TEST_F(Scenes, DropAWholeOfTheWrongDigest) {
  {
    Upload upload(*store_, "a.glb", 0, 5);
    upload.write("hello");
    EXPECT_EQ(refusal([&] { upload.finish("", sha256_hex("other"), true); })->kind(),
              RequestError::Kind::kInvalid);
  }
  EXPECT_FALSE(store_->find("a.glb"));
}

TEST_F(Scenes, AreWrittenByOneRequestAtATime) {
  Upload upload(*store_, "a.glb", 0, 5);
  EXPECT_EQ(refusal([&] { Upload(*store_, "a.glb", 0, 5); })->kind(),
            RequestError::Kind::kConflict);
  EXPECT_FALSE(refusal([&] { Upload(*store_, "b.glb", 0, 5); }));
}

// The old scene stays until the new one is complete.
TEST_F(Scenes, AreReplacedAtOnce) {
  {
    Upload upload(*store_, "a.glb", 0, 3);
    upload.write("old");
    upload.finish("", "", true);
    upload.publish();
  }
  Upload upload(*store_, "a.glb", 0, 3);
  upload.write("new");
  EXPECT_EQ(contents("a.glb"), "old");
  EXPECT_TRUE(store_->find("a.glb")->complete);
  upload.finish("", "", true);
  upload.publish();
  EXPECT_EQ(contents("a.glb"), "new");
}

TEST_F(Scenes, AreListedByNameAndRemoved) {
  for (const char* name : {"b.glb", "a.glb", "c.glb"}) {
    Upload upload(*store_, name, 0, 1);
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

TEST_F(Scenes, DropStaleUploads) {
  { Upload(*store_, "a.glb", 0, 5).write("abc"); }
  store_->remove_stale_uploads(0);
  EXPECT_TRUE(store_->upload("a.glb"));
  store_->remove_stale_uploads(1e12);
  EXPECT_FALSE(store_->upload("a.glb"));
  EXPECT_FALSE(system_files().exists(folder_.file("parts/a.glb")));
}

}  // namespace
}  // namespace voxdag::server
