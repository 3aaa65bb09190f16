// Uploads that are interrupted by an error of the disk, by another client, or by the end of the
// service.
#include <sys/socket.h>
#include <unistd.h>

#include <filesystem>

#include "core/base/clock.h"
#include "core/db/sqlite.h"
#include "core/format/checksum.h"
#include "core/io/forwarding_files.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kMiB = uint64_t{1} << 20;

// A disk with a size of `bytes`, on which only scenes and unfinished uploads take space. Calls
// on_part_read before each read of an unfinished upload.
class TestDisk : public ForwardingFiles {
 public:
  TestDisk() : ForwardingFiles(system_files()) {}

  uint64_t free_space(const std::string& path) override {
    uint64_t used = 0;
    for (const char* folder : {"/scenes/files", "/scenes/parts"})
      if (exists(path + folder))
        for (const DirectoryEntry& entry : list(path + folder)) used += entry.bytes;
    return bytes - std::min(bytes, used);
  }
  uint64_t bytes = uint64_t{1} << 40;
  std::function<void()> on_part_read;

 private:
  std::unique_ptr<ReadableFile> reader_of(std::unique_ptr<ReadableFile> file) override {
    if (!on_part_read || file->path().find("/parts/") == std::string::npos) return file;
    return std::make_unique<File>(std::move(file), on_part_read);
  }

  class File : public ForwardingReader {
   public:
    File(std::unique_ptr<ReadableFile> file, const std::function<void()>& hook)
        : ForwardingReader(std::move(file)), hook_(hook) {}
    void read_at(uint64_t offset, std::span<std::byte> out) const override {
      hook_();
      ForwardingReader::read_at(offset, out);
    }

   private:
    const std::function<void()>& hook_;
  };
};

class InterruptedUpload : public RunningService {
 protected:
  InterruptedUpload() { files_ = &disk_; }
  ~InterruptedUpload() override { stop(); }

  std::string data(const std::string& name) { return config_.data_folder + "/" + name; }
  int port() { return std::stoi(url().substr(url().rfind(':') + 1)); }
  std::string offset(const std::string& name) {
    return http_->head("/api/v1/scenes/" + name).header("Upload-Offset");
  }
  // Begins an upload that declares `size` bytes, and sends only `bytes`. Returns the socket.
  int begin_upload(const std::string& name, uint64_t size, const std::string& bytes) {
    const int socket = raw_connect(port());
    const std::string head =
        "PUT /api/v1/scenes/" + name +
        " HTTP/1.1\r\nHost: localhost\r\nContent-Length: " + std::to_string(size) + "\r\n\r\n" +
        bytes;
    for (size_t at = 0; at < head.size();) {
      const ssize_t sent = send(socket, head.data() + at, head.size() - at, MSG_NOSIGNAL);
      if (sent <= 0) break;
      at += static_cast<size_t>(sent);
    }
    return socket;
  }
  // Begins an upload, and sends only its header. Returns the first line of the answer up to the
  // status.
  std::string answer_to_upload(const std::string& name, uint64_t size) {
    const int socket = begin_upload(name, size, "");
    char answer[13] = {};
    EXPECT_EQ(recv(socket, answer, 12, MSG_WAITALL), 12);
    close(socket);
    return answer;
  }
  ClientResponse put_part(const std::string& bytes, size_t first, size_t end) {
    return put_scene(
        "m.glb", bytes.substr(first, end - first),
        {{"Content-Range", "bytes " + std::to_string(first) + "-" + std::to_string(end - 1) + "/" +
                               std::to_string(bytes.size())}});
  }
  ClientResponse put_empty_part(size_t total, const client::HeaderMap& more = {}) {
    client::HeaderMap headers = more;
    headers.emplace("Content-Range", "bytes */" + std::to_string(total));
    return put_scene("m.glb", "", headers);
  }

  TestDisk disk_;
};

// A deletion renames the scene's file to mark it, and then fails. The service deletes the marked
// file later, but keeps a new scene with the same name.
TEST_F(InterruptedUpload, SurvivesADeletionThatFailed) {
  start();
  const std::string path = "/api/v1/scenes/m.glb", bytes = scene_bytes();
  EXPECT_EQ(put_scene("m.glb", "old").status, 201);
  {
    SqlDatabase outside(data("scenes/scenes.db"), SqlDatabase::Mode::kReadWrite);
    const SqlTransaction locked(outside);
    EXPECT_EQ(http_->send("DELETE", path, "").status, 500);
  }
  EXPECT_EQ(put_scene("m.glb", bytes).status / 100, 2);
  stop();
  start();
  const Json scene = Json::parse(http_->get(path).body);
  EXPECT_EQ(scene["sha256"], sha256_hex(bytes));
  EXPECT_TRUE(std::filesystem::exists(data("scenes/files/m.glb")));
}

// Clients that declare uploads as large as the disk but send few bytes do not block other uploads
// or jobs, because their declared bytes are not reserved.
TEST_F(InterruptedUpload, IsNotBlockedBySlowOnes) {
  disk_.bytes = 200 * kMiB;
  config_.jobs.min_free_disk_bytes = 100 * kMiB;
  start();
  std::vector<int> sockets;
  for (const char* name : {"a.glb", "b.glb", "c.glb"}) {
    sockets.push_back(begin_upload(name, 80 * kMiB, std::string(300'000, 'x')));
    ASSERT_TRUE(until([&] { return !offset(name).empty(); }));
  }
  EXPECT_EQ(answer_to_upload("d.glb", 101 * kMiB), "HTTP/1.1 507");
  ASSERT_EQ(put_scene("m.glb", scene_bytes()).status, 201);
  EXPECT_TRUE(until_state(post_job({{"scene", "m.glb"}, {"resolution", 64}}), "succeeded"));
  for (const int socket : sockets) close(socket);
}

// An upload that starts over may use the space of the unfinished upload that it replaces, even if
// both together do not fit on the disk.
TEST_F(InterruptedUpload, StartsOverInItsOwnSpace) {
  disk_.bytes = 60 * kMiB;
  config_.jobs.min_free_disk_bytes = 8 * kMiB;
  start();
  const std::string whole(36 * kMiB, 'x');
  close(begin_upload("m.glb", whole.size(), whole.substr(0, 30 * kMiB)));
  ASSERT_TRUE(until([&] { return offset("m.glb") == std::to_string(30 * kMiB); }));
  // Until the service has noticed the closed connection, it refuses another upload of the scene.
  const auto is_put = [&] {
    try {
      return put_scene("m.glb", whole).status == 201;
    } catch (const Error&) {
      return false;  // the service refused the upload before it had all bytes
    }
  };
  EXPECT_TRUE(until(is_put));
  // An upload that does not fit leaves nothing behind.
  EXPECT_EQ(answer_to_upload("n.glb", whole.size()), "HTTP/1.1 507");
  EXPECT_EQ(http_->get("/api/v1/scenes/n.glb").status, 404);
}

// All bytes of a scene have arrived, but the service stops while it computes their digest. The next
// service finishes the upload, so the client need not send the bytes again.
TEST_F(InterruptedUpload, IsFinishedByTheNextService) {
  const std::string bytes = scene_bytes();
  ASSERT_GT(bytes.size(), 512u << 10) << "the digest reads it in several pieces";
  start();
  EXPECT_EQ(put_part(bytes, 0, 1000).status, 202);
  std::atomic<int> reads{0};
  disk_.on_part_read = [&] {
    if (++reads == 1) begin_stop();
  };
  EXPECT_EQ(not_problem(put_part(bytes, 1000, bytes.size()), 503, "busy"), "");
  EXPECT_EQ(reads, 1);
  stop();
  start();
  EXPECT_EQ(offset("m.glb"), std::to_string(bytes.size()));
  EXPECT_EQ(put_empty_part(bytes.size() + 1).status, 409);
  const client::HeaderMap digest = {{"Repr-Digest", digest_field(sha256_hex(bytes))}};
  const ClientResponse done = put_empty_part(bytes.size(), digest);
  EXPECT_EQ(done.status, 201) << done.body;
  EXPECT_EQ(Json::parse(done.body)["sha256"], sha256_hex(bytes));
}

TEST_F(InterruptedUpload, IsRefusedByAServiceThatStops) {
  std::atomic<bool> stops{false};
  config_.before_step = [&](const std::string& step) {
    if (stops && step == "answer PUT") begin_stop();
  };
  start();
  EXPECT_EQ(put_part("0123456789", 0, 5).status, 202);
  stops = true;
  EXPECT_EQ(not_problem(put_part("0123456789", 5, 10), 503, "busy"), "");
  stop();
  stops = false;
  start();
  EXPECT_EQ(offset("m.glb"), "5");
  EXPECT_EQ(put_part("0123456789", 5, 10).status, 201);
}

// A job is submitted while the last bytes of a new version of its scene arrive. The job uses the
// old version, so the upload ends with a conflict. After the job has ended, an empty part finishes
// the upload.
TEST_F(InterruptedUpload, IsFinishedAfterAJobThatUsedTheScene) {
  config_.jobs.min_free_disk_bytes = 100 * kMiB;
  start();
  const std::string bytes = scene_bytes();
  ASSERT_EQ(put_scene("m.glb", bytes).status, 201);
  disk_.bytes = kMiB;  // the job waits
  const std::string changed = bytes + "\n";
  EXPECT_EQ(put_part(changed, 0, 1000).status, 507);
  disk_.bytes = uint64_t{1} << 40;
  EXPECT_EQ(put_part(changed, 0, 1000).status, 202);
  std::string id;
  disk_.on_part_read = [&] {
    disk_.bytes = kMiB;
    if (id.empty()) {
      HttpClient other(ClientOptions{url(), "", "", 300});
      const ClientResponse posted =
          other.send("POST", "/api/v1/jobs", R"({"scene":"m.glb","resolution":64})",
                     {{"Content-Type", "application/json"}});
      id = Json::parse(posted.body).value("id", "?");
    }
  };
  EXPECT_EQ(not_problem(put_part(changed, 1000, changed.size()), 409, "conflict"), "");
  EXPECT_EQ(offset("m.glb"), std::to_string(changed.size()));
  disk_.bytes = uint64_t{1} << 40;
  EXPECT_TRUE(until_state(id, "succeeded"));
  EXPECT_EQ(put_empty_part(changed.size()).status, 200);
  EXPECT_EQ(Json::parse(http_->get("/api/v1/scenes/m.glb").body)["sha256"], sha256_hex(changed));
}

TEST_F(InterruptedUpload, HasNoEmptyPartOfAnotherForm) {
  start();
  for (const char* range : {"bytes */0", "bytes */", "bytes */x", "bytes */5x", "bytes */-5"})
    EXPECT_EQ(put_scene("m.glb", "", {{"Content-Range", range}}).status, 400) << range;
  EXPECT_EQ(put_scene("m.glb", "x", {{"Content-Range", "bytes */1"}}).status, 400);
  EXPECT_EQ(put_scene("m.glb", "").status, 400);
  EXPECT_EQ(put_empty_part(5).status, 409) << "there is no upload";
}

TEST_F(InterruptedUpload, IsNotAcknowledgedWithoutTheDatabase) {
  start();
  std::filesystem::rename(data("scenes/scenes.db"), data("away"));
  EXPECT_EQ(put_scene("m.glb", "x").status, 500);
  EXPECT_EQ(put_part("0123456789", 0, 5).status, 500);
  std::filesystem::rename(data("away"), data("scenes/scenes.db"));
  EXPECT_EQ(put_scene("m.glb", "x").status, 201);
}

// A clock that is far ahead for a while does not cause old uploads to be deleted.
TEST_F(InterruptedUpload, OutlivesAClockThatJumped) {
  const auto age = [&](const std::string& seconds) {
    SqlDatabase(data("scenes/scenes.db"), SqlDatabase::Mode::kReadWrite)
        .execute("UPDATE upload SET updated_s = updated_s - " + seconds +
                 "; UPDATE scene SET modified_s = modified_s - " + seconds);
  };
  start();
  EXPECT_EQ(put_part("0123456789", 0, 5).status, 202);
  stop();
  age("63072000");  // relative to the records, the clock is now two years ahead
  start();
  EXPECT_TRUE(until([&] { return log().find("no upload is deleted") != std::string::npos; }));
  EXPECT_EQ(offset("m.glb"), "5");
  // The new scene n.glb proves that the clock is right. So m.glb really is old, and the next start
  // deletes it.
  EXPECT_EQ(put_scene("n.glb", "x").status, 201);
  stop();
  start();
  EXPECT_TRUE(until([&] { return http_->get("/api/v1/scenes/m.glb").status == 404; }));
}

}  // namespace
}  // namespace voxdag::server
