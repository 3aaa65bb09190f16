#include "client/scene_upload.h"

#include <algorithm>
#include <charconv>
#include <memory>
#include <optional>

#include "client/retry_policy.h"
#include "core/base/error.h"
#include "core/fields/json_text.h"
#include "core/format/checksum.h"

namespace voxdag::client {
namespace {

constexpr size_t kPieceBytes = 1 << 20;
constexpr uint64_t kFirstPartBytes = 64 << 10;
constexpr uint64_t kPartBytes = 64 << 20;
constexpr size_t kDigitsInName = 12;
constexpr size_t kMaxStemChars = 100, kMaxEndingChars = 10;

// Returns the name that a local file has on the server: "/a/My hall.glb" becomes
// "My-hall-3f2a91c05b77.glb". The digits are the beginning of `sha256`. The server accepts the name
// if it can read files with this ending.
std::string name_on_server(const std::string& path, const std::string& sha256) {
  std::string stem = path.substr(path.rfind('/') + 1);
  const size_t dot = stem.rfind('.');
  std::string ending = dot == std::string::npos ? "" : stem.substr(dot);
  stem.resize(std::min({dot, stem.size(), kMaxStemChars}));
  ending.resize(std::min(ending.size(), kMaxEndingChars));
  for (std::string* text : {&stem, &ending})
    for (char& c : *text)
      if (!isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '_') c = '-';
  if (stem.empty() || !isalnum(static_cast<unsigned char>(stem[0]))) stem.insert(0, "scene");
  return stem + "-" + sha256.substr(0, kDigitsInName) + ending;
}

class Upload {
 public:
  Upload(ServiceClient& service, FileSystem& files, const std::string& path, Progress& progress)
      : service_(service), progress_(progress), file_(files.open_read(path)), size_(file_->size()) {
    if (size_ == 0)
      throw Error(ErrorCode::kInvalidInput,
                  "scene " + path + ": the file is empty, expected a scene file with contents");
    progress.begin_stage("checksum", size_, "bytes");
    sha256_ = sha256_of_file(*file_, service.cancel(), &progress);
    name_ = name_on_server(path, sha256_);
  }

  std::string run() {
    uint64_t max_offset = 0;
    for (RetryPolicy retry(service_.cancel()); !is_complete();) {
      if (offset_ > max_offset) retry.reset();
      max_offset = std::max(max_offset, offset_);
      if (send_rest()) break;
      if (!retry.wait(wait_s_)) throw Error(ErrorCode::kIo, failure_);
    }
    return name_;
  }

 private:
  std::string path_on_server() const { return "/api/v1/scenes/" + name_; }

  std::string read_piece(uint64_t offset, uint64_t max_bytes) {
    std::string bytes(static_cast<size_t>(std::min<uint64_t>(max_bytes, kPieceBytes)), '\0');
    file_failed_ = true;
    file_->read_at(offset, std::as_writable_bytes(std::span(bytes)));
    file_failed_ = false;
    return bytes;
  }

  // Requests the state of the upload from the server. Returns true if the server has the complete
  // file; otherwise sets offset_ to the number of bytes that the server has.
  bool is_complete() {
    offset_ = 0;
    try {
      const ClientResponse answer =
          service_.send_with_retries([&](HttpClient& http) { return http.get(path_on_server()); });
      const Json scene = parse_json<Json>(answer.body);
      if (scene.at("complete").get<bool>() && scene.at("sha256") == sha256_) return true;
      const std::string text = answer.header("Upload-Offset");
      uint64_t offset = 0;
      const auto parsed = std::from_chars(text.data(), text.data() + text.size(), offset);
      if (parsed.ec == std::errc{} && offset <= size_) offset_ = offset;
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kInvalidInput)
        throw Error(error.code(), "scene " + file_->path() + ": " + error.message());
      if (error.code() != ErrorCode::kNotFound) throw;
    }
    return false;
  }

  // Sends the missing bytes in parts, one request each, so that a crash of the server loses at most
  // one part. The first part is small, because a server that rejects the scene can answer after a
  // small part, but closes the connection during a large part. If no bytes are missing, sends an
  // empty part, which finishes the upload. Returns true if the upload is complete. Otherwise
  // failure_ has the reason, and the caller tries again.
  bool send_rest() {
    progress_.begin_stage("upload", size_, "bytes");
    progress_.resume_at(offset_);
    uint64_t part_bytes = kFirstPartBytes;
    do {
      const uint64_t end = std::min(size_, offset_ + part_bytes);
      const auto answer = send_part(end);
      if (!answer) return false;
      wait_s_ = retry_after_s(*answer);
      if (answer->status == 409 || wait_s_ >= 0) {
        failure_ = "scene " + name_ + ": the server answered the bytes from " +
                   std::to_string(offset_) + " on with status " + std::to_string(answer->status) +
                   ", expected 200 to 202";
        return false;
      }
      throw_if_problem(*answer);
      offset_ = end;
      part_bytes = kPartBytes;
    } while (offset_ < size_);
    progress_.end_stage();
    return true;
  }

  // Sends the bytes from offset_ to `end` and returns the server's answer. Returns nullopt if the
  // connection broke; the reason is then in failure_.
  std::optional<ClientResponse> send_part(uint64_t end) {
    const uint64_t first = offset_;
    const std::string range =
        first == end ? "*" : std::to_string(first) + "-" + std::to_string(end - 1);
    HeaderMap headers{{"Content-Range", "bytes " + range + "/" + std::to_string(size_)}};
    if (end == size_) headers.emplace("Repr-Digest", digest_field(sha256_));
    const auto source = [&](uint64_t offset, uint64_t max_bytes) {
      service_.cancel().check();
      std::string bytes = read_piece(first + offset, max_bytes);
      progress_.advance(bytes.size());
      return bytes;
    };
    try {
      return service_.http().upload(path_on_server(), end - first, source, headers);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kIo || file_failed_) throw;
      failure_ = error.message();
      wait_s_ = 0;
      return std::nullopt;
    }
  }

  ServiceClient& service_;
  Progress& progress_;
  const std::unique_ptr<ReadableFile> file_;
  const uint64_t size_;
  std::string sha256_, name_;
  uint64_t offset_ = 0;       // bytes that the server has
  bool file_failed_ = false;  // the last error was in the local file, not in the connection
  std::string failure_;       // error of the last attempt
  double wait_s_ = 0;         // pause that a busy server has requested
};

}  // namespace

std::string upload_scene(ServiceClient& service, FileSystem& files, const std::string& path,
                         Progress& progress) {
  return Upload(service, files, path, progress).run();
}

}  // namespace voxdag::client
