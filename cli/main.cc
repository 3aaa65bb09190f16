#include <poll.h>
#include <sys/types.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <exception>
#include <new>
#include <system_error>

#include "cli/command.h"
#include "cli/terminal/signals.h"
#include "core/base/process_limits.h"
#include "core/base/text/printable.h"

namespace voxdag::cli {
namespace {

// Exit status after an unexpected exception (docs/errors.md). It equals EX_SOFTWARE of sysexits.h.
constexpr int kDefectStatus = 70;

CancelToken g_cancel;

int report(const Error& error) {
  std::fprintf(stderr, "voxdag: error: %s\n", printable_line(error.what()).c_str());
  return exit_status(error.code());
}

// True if standard output is a pipe that its reader has closed.
bool is_reader_gone() {
  pollfd output{STDOUT_FILENO, POLLOUT, 0};
  return poll(&output, 1, 0) > 0 && (output.revents & POLLERR) != 0;
}

// Ends the process by SIGPIPE, without a message, like a program that does not handle this signal.
[[noreturn]] void end_by_closed_pipe() {
  std::signal(SIGPIPE, SIG_DFL);
  std::raise(SIGPIPE);
  _exit(128 + SIGPIPE);  // the caller of this process has blocked the signal
}

// The value of errno of the first failed write to standard output; 0 if none failed. The stream
// does not keep it, so a long output, which takes several writes, would lose the reason.
int g_output_errno = 0;

// Writes all bytes, because the stream regards a smaller number as an error.
ssize_t write_output(void*, const char* text, size_t bytes) {
  size_t done = 0;
  while (done < bytes) {
    const ssize_t written = write(STDOUT_FILENO, text + done, bytes - done);
    if (written >= 0) {
      done += static_cast<size_t>(written);
    } else if (errno != EINTR) {
      if (!g_output_errno) g_output_errno = errno;
      break;
    }
  }
  return static_cast<ssize_t>(done);
}

// Replaces `stdout` by a stream that records why a write failed.
void watch_output() {
  FILE* const output = fopencookie(nullptr, "w", {nullptr, write_output, nullptr, nullptr});
  if (!output) return;  // too little memory: the first allocation of the command reports it
  std::setvbuf(output, nullptr, isatty(STDOUT_FILENO) == 1 ? _IOLBF : _IOFBF, BUFSIZ);
  stdout = output;
}

// Flushes standard output. Throws if the buffered text cannot be written, so that the command
// fails. If its reader has closed the pipe, as `head` does after the first lines, ends the process
// without a message, because the reader needs no more.
void check_output() {
  const bool is_flushed = std::fflush(stdout) == 0 && !std::ferror(stdout);
  if (is_flushed && !g_output_errno) return;
  const int reason = g_output_errno ? g_output_errno : EIO;
  if (reason == EPIPE || is_reader_gone()) end_by_closed_pipe();
  throw Error(code_of_errno(reason), "write to the standard output: " + errno_text(reason));
}

int run(int argc, char** argv) {
  CommandContext context{system_files(), g_cancel};
  CommandLine line(context);
  // Help lists the commands in this order.
  for (const auto add_command : {
           add_build_command,
#ifdef VOXDAG_HAS_CLUSTER
           add_build_batch_command, add_stop_tasks_command,
#endif
           add_plan_command,        add_status_command,     add_info_command,
           add_verify_command,      add_diff_command,
#ifdef VOXDAG_HAS_GENERATORS
           add_generate_command,
#endif
#ifdef VOXDAG_HAS_ASSIMP
           add_import_command,
#endif
           add_render_command,      add_extract_command,    add_combine_command,
           add_edit_command,        add_reorder_command,    add_export_command,
#ifdef VOXDAG_HAS_VIEWER
           add_view_command,        add_publish_command,
#endif
#ifdef VOXDAG_HAS_SERVER
           add_serve_commands,      add_health_command,     add_submit_command,
           add_jobs_command,        add_watch_command,      add_job_action_commands,
           add_download_command,    add_exports_command,
#endif
           add_version_command,
       })
    add_command(line);
  try {
    const int status = line.run(argc, argv);
    check_output();
    return status;
  } catch (const Error& error) {
    return report(error);
  } catch (const std::system_error& error) {
    return report(error_of(error));
  } catch (const std::bad_alloc&) {
    return report(out_of_memory_error());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "voxdag: error: a defect of voxdag, please report it: %s\n",
                 printable_line(error.what()).c_str());
    return kDefectStatus;
  }
}

}  // namespace
}  // namespace voxdag::cli

int main(int argc, char** argv) {
  voxdag::return_freed_memory_to_system();
  voxdag::cli::watch_output();
  voxdag::cli::catch_signals(voxdag::cli::g_cancel);
  return voxdag::cli::run(argc, argv);
}
