#include "cli/service/fetch.h"

#include <vector>

#include "cli/terminal/progress_bar.h"
#include "core/format/checksum.h"

namespace voxdag::cli {
namespace {

constexpr size_t kPiece = 1 << 20;
constexpr size_t kDigitsInName = 12;

class Fetch {
 public:
  Fetch(Server& server, const Json& job, const std::string& output)
      : server_(server),
        path_(job_path(job.at("id")) + "/dag"),
        output_(output),
        sha256_(job.at("result").at("sha256")),
        size_(job.at("result").at("bytes")),
        partial_(output + "." + sha256_.substr(0, kDigitsInName) + ".partial") {}

  Fetched run() {
    FileSystem& files = server_.files();
    files.make_directories(parent_directory(output_));
    const uint64_t resumed_at = bytes_there();
    for (RetryPolicy patience(server_.cancel()); bytes_there() < size_;) {
      const uint64_t before = bytes_there();
      std::string trouble = "server " + server_.url() + ": the download ended early";
      double wait_s = 0;
      try {
        wait_s = fetch_rest(before);
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kIo || file_failed_) throw;
        trouble = error.message();
      }
      if (bytes_there() > before) patience.renew();
      if (bytes_there() < size_ && !patience.wait(wait_s)) throw Error(ErrorCode::kIo, trouble);
    }
    check();
    files.rename(partial_, output_);
    files.sync_directory(parent_directory(output_));
    return {size_, resumed_at, sha256_};
  }

 private:
  // 0 if what is there cannot be a beginning.
  uint64_t bytes_there() const {
    if (!server_.files().exists(partial_)) return 0;
    const uint64_t bytes = server_.files().open_read(partial_)->size();
    return bytes <= size_ ? bytes : 0;
  }

  // One request. Returns the seconds that a busy server asks to wait for.
  double fetch_rest(uint64_t offset) {
    client::HeaderMap headers;
    if (offset > 0) {
      headers.emplace("Range", "bytes=" + std::to_string(offset) + "-");
      headers.emplace("If-Range", "\"" + sha256_ + "\"");
    }
    const auto progress = make_progress_bar();
    std::unique_ptr<WritableFile> file;
    const auto begin = [&](const client::ClientResponse& head) {
      if (head.status >= 400) return true;
      if (head.status != 206) offset = 0;  // from the start
      guarded([&] {
        file = offset > 0 ? server_.files().open_write(partial_) : server_.files().create(partial_);
      });
      progress->begin_stage("download", size_ - offset, "bytes");
      return true;
    };
    const auto sink = [&](std::string_view bytes) {
      server_.cancel().check();
      if (bytes.size() > size_ - offset) throw_corrupt("more bytes than the job made");
      guarded([&] { file->write_at(offset, std::as_bytes(std::span(bytes))); });
      offset += bytes.size();
      progress->advance(bytes.size());
      return true;
    };
    const client::ClientResponse answer = server_.http().stream(path_, headers, begin, sink);
    const double wait_s = retry_after_s(answer);
    if (wait_s >= 0) return wait_s;
    throw_if_problem(answer);
    if (offset == size_) progress->end_stage();
    guarded([&] { file->sync(); });
    return 0;
  }

  // Errors of the disk are not those of the connection, though both are kIo.
  template <class Step>
  void guarded(const Step& step) {
    file_failed_ = true;
    step();
    file_failed_ = false;
  }

  void check() {
    const auto file = server_.files().open_read(partial_);
    Sha256 sha256;
    std::vector<std::byte> bytes(kPiece);
    for (uint64_t at = 0; at < size_;) {
      server_.cancel().check();
      const std::span piece(bytes.data(),
                            static_cast<size_t>(std::min<uint64_t>(kPiece, size_ - at)));
      file->read_at(at, piece);
      sha256.add(piece);
      at += piece.size();
    }
    if (sha256.finish() == sha256_) return;
    server_.files().remove(partial_);
    throw_corrupt("expected SHA-256 " + sha256_ + "; what came was thrown away");
  }

  [[noreturn]] void throw_corrupt(const std::string& what) const {
    throw Error(ErrorCode::kCorrupt, output_ + ": not the bytes of the job: " + what);
  }

  Server& server_;
  const std::string path_, output_, sha256_;
  const uint64_t size_;
  const std::string partial_;
  bool file_failed_ = false;
};

}  // namespace

Fetched fetch_result(Server& server, const Json& job, const std::string& output) {
  if (job.at("state") != "succeeded")
    throw Error(ErrorCode::kNotFound, "job " + job.at("id").get<std::string>() + " is " +
                                          job.at("state").get<std::string>() +
                                          ": expected one that has succeeded");
  return Fetch(server, job, output).run();
}

}  // namespace voxdag::cli
