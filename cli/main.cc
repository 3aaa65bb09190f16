#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <system_error>

#include "cli/command.h"
#include "core/base/process_limits.h"
#include "core/base/text/printable.h"

namespace voxdag::cli {
namespace {

// Exit status after an unexpected exception (docs/errors.md). It equals EX_SOFTWARE of sysexits.h.
constexpr int kDefectStatus = 70;

CancelToken g_cancel;

// The first signal cancels the command; a second one terminates the process.
void on_signal(int signal) {
  if (g_cancel.canceled()) _Exit(128 + signal);
  g_cancel.cancel();
}

void catch_signals() {
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // SIGHUP means that the terminal was closed. It remains ignored if nohup has set it to be
  // ignored.
  struct sigaction hangup {};
  sigaction(SIGHUP, nullptr, &hangup);
  if (hangup.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
  signal(SIGPIPE, SIG_IGN);
}

int report(ErrorCode code, const char* message) {
  std::fprintf(stderr, "voxdag: error: %s\n", printable_line(message).c_str());
  return exit_status(code);
}

// Flushes standard output. Throws if the buffered text cannot be written, so that the command
// fails.
void check_output() {
  errno = 0;
  if (std::fflush(stdout) == 0 && !std::ferror(stdout)) return;
  throw Error(
      errno == ENOSPC ? ErrorCode::kNoSpace : ErrorCode::kIo,
      "write to the standard output: " + std::generic_category().message(errno ? errno : EIO));
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
           add_render_command,      add_extract_command,    add_export_command,
#ifdef VOXDAG_HAS_VIEWER
           add_view_command,
#endif
#ifdef VOXDAG_HAS_SERVER
           add_serve_commands,      add_health_command,     add_submit_command,
           add_jobs_command,        add_watch_command,      add_job_action_commands,
           add_download_command,
#endif
       })
    add_command(line);
  try {
    const int status = line.run(argc, argv);
    check_output();
    return status;
  } catch (const Error& error) {
    return report(error.code(), error.what());
  } catch (const std::system_error& error) {
    return report(ErrorCode::kOutOfMemory, error.what());
  } catch (const std::bad_alloc&) {
    return report(ErrorCode::kOutOfMemory, "out of memory: the system refused an allocation");
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
  voxdag::cli::catch_signals();
  return voxdag::cli::run(argc, argv);
}
