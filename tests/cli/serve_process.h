// A `voxdag serve` process for one test, on a free port of the loopback interface.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace command_line {

// The server accepts connections when the constructor returns. The destructor stops it.
class ServeProcess {
 public:
  // Stores its data and its log in `folder`.
  explicit ServeProcess(const std::string& folder, const std::vector<std::string>& more = {},
                        const std::string& port = "0");
  ~ServeProcess();
  ServeProcess(const ServeProcess&) = delete;
  ServeProcess& operator=(const ServeProcess&) = delete;

  const std::string& url() const { return url_; }  // "" if it did not start
  // Sends SIGTERM and returns the exit status.
  int stop();
  std::string log() const;

 private:
  void wait_until_it_listens();
  bool is_running();

  const std::string log_path_;
  pid_t pid_ = 0;
  std::string url_;
};

}  // namespace command_line
