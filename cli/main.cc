#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <system_error>

#include "cli/command.h"
#include "core/base/error.h"

namespace voxdag::cli {
namespace {

CancelToken g_cancel;

// The first signal cancels the command, a second one terminates the process.
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
  signal(SIGPIPE, SIG_IGN);
}

int report(ErrorCode code, const char* message) {
  std::fprintf(stderr, "voxdag: error: %s\n", message);
  return exit_status(code);
}

int run(int argc, char** argv) {
  CLI::App app{"voxdag: builds sparse voxel DAGs of huge triangle scenes, out of core", "voxdag"};
  app.set_version_flag("--version", VOXDAG_VERSION);
  app.require_subcommand(1);
  CommandContext context{system_files(), g_cancel};
  add_build_command(app, context);
  add_plan_command(app, context);
  add_status_command(app, context);
  add_info_command(app, context);
  add_verify_command(app, context);
  add_diff_command(app, context);
  add_generate_command(app, context);
  add_render_command(app, context);
  add_serve_commands(app, context);
  add_submit_command(app, context);
  add_jobs_command(app, context);
  add_watch_command(app, context);
  add_cancel_command(app, context);
  add_suspend_command(app, context);
  add_resume_command(app, context);
  add_download_command(app, context);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // CLI11 reports --help and --version as errors of status 0; any other is invalid input.
    return app.exit(error) == 0 ? 0 : exit_status(ErrorCode::kInvalidInput);
  } catch (const Error& error) {
    return report(error.code(), error.what());
  } catch (const std::system_error& error) {
    return report(ErrorCode::kOutOfMemory, error.what());
  } catch (const std::bad_alloc&) {
    return report(ErrorCode::kOutOfMemory, "out of memory: the system refused an allocation");
  }
  return context.exit_status;
}

}  // namespace
}  // namespace voxdag::cli

int main(int argc, char** argv) {
  voxdag::cli::catch_signals();
  return voxdag::cli::run(argc, argv);
}
