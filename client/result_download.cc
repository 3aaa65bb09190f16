#include "client/result_download.h"

#include <memory>

#include "client/retry_policy.h"
#include "core/base/error.h"
#include "core/format/checksum.h"

namespace voxdag::client {
namespace {

constexpr size_t kDigitsInPartialName = 12;

class Download {
 public:
  Download(ServiceClient& service, FileSystem& files, const RemoteFile& file,
           const std::string& output, Progress& progress)
      : service_(service),
        files_(files),
        progress_(progress),
        path_(file.path),
        output_(output),
        sha256_(file.sha256),
        size_(file.bytes),
        partial_(output + "." + sha256_.substr(0, kDigitsInPartialName) + ".partial") {}

  DownloadResult run() {
    files_.make_directories(parent_directory(output_));
    const uint64_t resumed_bytes = bytes_present();
    if (size_ == 0) files_.create(partial_)->close();
    for (RetryPolicy retry(service_.cancel()); bytes_present() < size_;) {
      const uint64_t before = bytes_present();
      std::string reason = "server " + service_.url() + ": the download ended after " +
                           std::to_string(before) + " bytes, expected " + std::to_string(size_);
      double wait_s = 0;
      try {
        wait_s = fetch_rest(before);
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kIo || file_failed_) throw;
        reason = error.message();
      }
      if (bytes_present() > before) retry.reset();
      if (bytes_present() < size_ && !retry.wait(wait_s)) throw Error(ErrorCode::kIo, reason);
    }
    verify();
    files_.rename(partial_, output_);
    files_.sync_directory(parent_directory(output_));
    return {size_, resumed_bytes, sha256_};
  }

 private:
  // Returns the number of bytes in the partial file; 0 if this file is longer than the result.
  uint64_t bytes_present() const {
    if (!files_.exists(partial_)) return 0;
    const uint64_t bytes = files_.open_read(partial_)->size();
    return bytes <= size_ ? bytes : 0;
  }

  // Requests the bytes from `offset` on and writes them to the partial file at `offset`. Returns
  // the number of seconds to wait before the next attempt: the time that a busy server requested,
  // otherwise 0.
  double fetch_rest(uint64_t offset) {
    HeaderMap headers;
    if (offset > 0) {
      headers.emplace("Range", "bytes=" + std::to_string(offset) + "-");
      headers.emplace("If-Range", "\"" + sha256_ + "\"");
    }
    std::unique_ptr<WritableFile> file;
    const auto begin = [&](const ClientResponse& head) {
      if (head.status >= 400) return true;
      if (head.status != 206) offset = 0;  // the server sends the complete file
      guard_file(
          [&] { file = offset > 0 ? files_.open_write(partial_) : files_.create(partial_); });
      progress_.begin_stage("download", size_, "bytes");
      progress_.resume_at(offset);
      return true;
    };
    const auto sink = [&](std::string_view bytes) {
      service_.cancel().check();
      if (bytes.size() > size_ - offset)
        throw_corrupt("more than " + std::to_string(size_) + " bytes arrived, expected " +
                      std::to_string(size_));
      guard_file([&] { file->write_at(offset, std::as_bytes(std::span(bytes))); });
      offset += bytes.size();
      progress_.advance(bytes.size());
      return true;
    };
    const ClientResponse answer = service_.http().stream(path_, headers, begin, sink);
    const double wait_s = retry_after_s(answer);
    if (wait_s >= 0) return wait_s;
    throw_if_problem(answer);
    if (offset == size_) progress_.end_stage();
    guard_file([&] { file->sync(); });
    return 0;
  }

  // Runs `step`, which accesses the local file. If `step` throws, file_failed_ remains true, and
  // the download is not retried. The flag is necessary because errors of the connection are also
  // Error{kIo}, but a retry can succeed after them.
  template <class Step>
  void guard_file(const Step& step) {
    file_failed_ = true;
    step();
    file_failed_ = false;
  }

  void verify() {
    const std::string found = sha256_of_file(*files_.open_read(partial_), service_.cancel());
    if (found == sha256_) return;
    files_.remove(partial_);
    throw_corrupt("SHA-256 " + found + ", expected " + sha256_ + "; the partial file was removed");
  }

  [[noreturn]] void throw_corrupt(const std::string& what) const {
    throw Error(ErrorCode::kCorrupt, output_ + ": the download differs from the result: " + what);
  }

  ServiceClient& service_;
  FileSystem& files_;
  Progress& progress_;
  const std::string path_, output_, sha256_;
  const uint64_t size_;
  const std::string partial_;
  bool file_failed_ = false;
};

}  // namespace

DownloadResult download_file(ServiceClient& service, FileSystem& files, const RemoteFile& file,
                             const std::string& output, Progress& progress) {
  return Download(service, files, file, output, progress).run();
}

DownloadResult download_result(ServiceClient& service, FileSystem& files, const Json& job,
                               const std::string& output, Progress& progress) {
  if (job.at("state") != "succeeded")
    throw Error(ErrorCode::kNotFound, "job " + job.at("id").get<std::string>() + " is " +
                                          job.at("state").get<std::string>() +
                                          ": expected a succeeded job");
  const Json& result = job.at("result");
  return download_file(service, files,
                       {job_path(job.at("id")) + "/dag", result.at("bytes"), result.at("sha256")},
                       output, progress);
}

}  // namespace voxdag::client
