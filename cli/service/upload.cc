#include "cli/service/upload.h"

#include <charconv>
#include <optional>

#include "cli/terminal/progress_bar.h"
#include "core/format/checksum.h"
#include "server/http/digest_field.h"

namespace voxdag::cli {
namespace {

constexpr size_t kPiece = 1 << 20;
constexpr uint64_t kGoesAhead = 64 << 10;
constexpr uint64_t kPart = 64 << 20;
constexpr size_t kDigitsInName = 12;
constexpr size_t kLongestStem = 100;

// "/a/My hall.glb" -> "My-hall-3f2a91c05b77.glb": a name as the API asks for.
std::string name_on_server(const std::string& path, const std::string& sha256) {
  std::string stem = path.substr(path.rfind('/') + 1);
  const size_t dot = stem.rfind('.');
  const std::string ending = dot == std::string::npos ? "" : stem.substr(dot);
  if (ending != ".glb" && ending != ".gltf")
    throw Error(ErrorCode::kInvalidInput, "scene " + path + ": expected a .glb or .gltf file");
  stem.resize(std::min(dot, kLongestStem));
  for (char& c : stem)
    if (!isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '_') c = '-';
  if (stem.empty() || !isalnum(static_cast<unsigned char>(stem[0]))) stem.insert(0, "scene");
  return stem + "-" + sha256.substr(0, kDigitsInName) + ending;
}

class Upload {
 public:
  Upload(Server& server, const std::string& path)
      : server_(server), file_(server.files().open_read(path)), size_(file_->size()) {
    if (size_ == 0) throw Error(ErrorCode::kInvalidInput, "scene " + path + ": the file is empty");
    digest();
    name_ = name_on_server(path, sha256_);
  }

  std::string run() {
    uint64_t furthest = 0;
    for (RetryPolicy patience(server_.cancel()); !is_there();) {
      if (offset_ > furthest) patience.renew();
      furthest = std::max(furthest, offset_);
      if (send_rest()) break;
      if (!patience.wait(wait_s_)) throw Error(ErrorCode::kIo, trouble_);
    }
    return name_;
  }

 private:
  std::string path_on_server() const { return "/api/v1/scenes/" + name_; }

  std::string piece(uint64_t offset, uint64_t most) {
    std::string bytes(static_cast<size_t>(std::min<uint64_t>(most, kPiece)), '\0');
    file_failed_ = true;
    file_->read_at(offset, std::as_writable_bytes(std::span(bytes)));
    file_failed_ = false;
    return bytes;
  }

  void digest() {
    Sha256 sha256;
    const auto progress = make_progress_bar();
    progress->begin_stage("checksum", size_, "bytes");
    for (uint64_t at = 0; at < size_;) {
      server_.cancel().check();
      const std::string bytes = piece(at, size_ - at);
      sha256.add(std::as_bytes(std::span(bytes)));
      at += bytes.size();
      progress->advance(bytes.size());
    }
    sha256_ = sha256.finish();
  }

  // Whether the server has the whole file; sets offset_ to how much of it there is.
  bool is_there() {
    offset_ = 0;
    try {
      const client::ClientResponse answer =
          server_.ask([&](client::HttpClient& http) { return http.get(path_on_server()); });
      const Json scene = Json::parse(answer.body);
      if (scene.at("complete").get<bool>() && scene.at("sha256") == sha256_) return true;
      take_offset(answer);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound) throw;
    }
    return false;
  }

  void take_offset(const client::ClientResponse& response) {
    const std::string text = response.header("Upload-Offset");
    uint64_t offset = 0;
    const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), offset);
    if (failure == std::errc{} && offset < size_) offset_ = offset;
  }

  // Sends what is missing, in parts, of which a server that crashes loses one at most. False if it
  // has to be tried again: trouble_ says why. A little goes ahead: a server that does not want the
  // scene at all can say so then; on more it would hang up.
  bool send_rest() {
    const auto progress = make_progress_bar();
    progress->begin_stage("upload", size_ - offset_, "bytes");
    for (uint64_t part = kGoesAhead; offset_ < size_; part = kPart) {
      const uint64_t end = std::min(size_, offset_ + part);
      const auto answer = send_part(end, *progress);
      if (!answer) return false;
      wait_s_ = retry_after_s(*answer);
      if (answer->status == 409 || wait_s_ >= 0) {
        trouble_ = "scene " + name_ + ": the server answered " + std::to_string(answer->status);
        return false;
      }
      throw_if_problem(*answer);
      offset_ = end;
    }
    progress->end_stage();
    return true;
  }

  // Nothing if the connection broke.
  std::optional<client::ClientResponse> send_part(uint64_t end, Progress& progress) {
    const uint64_t first = offset_;
    client::HeaderMap headers{{"Content-Range", "bytes " + std::to_string(first) + "-" +
                                                    std::to_string(end - 1) + "/" +
                                                    std::to_string(size_)}};
    if (end == size_) headers.emplace("Repr-Digest", server::digest_field(sha256_));
    const auto source = [&](uint64_t offset, uint64_t most) {
      server_.cancel().check();
      std::string bytes = piece(first + offset, most);
      progress.advance(bytes.size());
      return bytes;
    };
    try {
      return server_.http().upload(path_on_server(), end - first, source, headers);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kIo || file_failed_) throw;
      trouble_ = error.message();
      wait_s_ = 0;
      return std::nullopt;
    }
  }

  Server& server_;
  const std::unique_ptr<ReadableFile> file_;
  const uint64_t size_;
  std::string sha256_, name_;
  uint64_t offset_ = 0;       // bytes that the server has
  bool file_failed_ = false;  // reading it, not the connection
  std::string trouble_;       // what was in the way of the last attempt
  double wait_s_ = 0;         // that a busy server asks for
};

}  // namespace

std::string upload_scene(Server& server, const std::string& path) {
  return Upload(server, path).run();
}

}  // namespace voxdag::cli
