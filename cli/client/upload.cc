#include "cli/client/upload.h"

#include <charconv>

#include "cli/progress_bar.h"
#include "core/format/checksum.h"
#include "server/digest.h"

namespace voxdag::cli {
namespace {

constexpr size_t kPiece = 1 << 20;
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
    digest();
    name_ = name_on_server(path, sha256_);
  }

  std::string run() {
    if (is_there()) return name_;
    Patience patience(server_.cancel());
    for (bool begun = false;; begun = true) {
      const uint64_t before = offset_;
      std::string trouble;
      double wait_s = 0;
      try {
        if (begun && is_there()) break;
        if (send_rest(trouble, wait_s)) break;
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kIo || file_failed_) throw;
        trouble = error.message();
      }
      if (offset_ > before) patience.renew();
      if (!patience.wait(wait_s)) throw Error(ErrorCode::kIo, trouble);
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

  // Whether the server has the whole file; sets offset_ to what it has.
  bool is_there() {
    const server::ClientResponse head = server_.http().head(path_on_server());
    offset_ = 0;
    if (head.status == 404) return false;
    if (head.status >= 400) {  // a HEAD has no body that says more
      throw_if_problem(server_.http().get(path_on_server()));
    }
    const Json scene = Json::parse(server_.http().get(path_on_server()).body);
    if (scene.at("complete").get<bool>() && scene.at("sha256") == sha256_) return true;
    take_offset(head);
    return false;
  }

  void take_offset(const server::ClientResponse& response) {
    const std::string text = response.header("Upload-Offset");
    uint64_t offset = 0;
    const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), offset);
    if (failure == std::errc{} && offset < size_) offset_ = offset;
  }

  // Sends what is missing. False if it has to be tried again, saying why.
  bool send_rest(std::string& trouble, double& wait_s) {
    server::HeaderMap headers{{"Repr-Digest", server::digest_field(sha256_)}};
    if (offset_ > 0)
      headers.emplace("Content-Range", "bytes " + std::to_string(offset_) + "-" +
                                           std::to_string(size_ - 1) + "/" + std::to_string(size_));
    const auto progress = make_progress_bar();
    progress->begin_stage("upload", size_ - offset_, "bytes");
    const uint64_t first = offset_;
    const server::ClientResponse answer = server_.http().upload(
        path_on_server(), size_ - first,
        [&](uint64_t offset, uint64_t most) {
          server_.cancel().check();
          std::string bytes = piece(first + offset, most);
          progress->advance(bytes.size());
          return bytes;
        },
        headers);
    wait_s = come_again_s(answer);
    if (answer.status < 400 || (answer.status != 409 && wait_s < 0)) {
      throw_if_problem(answer);
      progress->end_stage();
      return true;
    }
    trouble = "scene " + name_ + ": the server answered " + std::to_string(answer.status);
    return false;
  }

  Server& server_;
  const std::unique_ptr<ReadableFile> file_;
  const uint64_t size_;
  std::string sha256_, name_;
  uint64_t offset_ = 0;       // bytes that the server has
  bool file_failed_ = false;  // reading it, not the connection
};

}  // namespace

std::string upload_scene(Server& server, const std::string& path) {
  return Upload(server, path).run();
}

}  // namespace voxdag::cli
