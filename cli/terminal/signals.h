// Signals that stop a command: SIGINT (Ctrl-C), SIGTERM and SIGHUP.
//
// The first signal cancels the command's token. Long-running code checks the token, so the command
// usually ends within milliseconds. Some code cannot check the token, for example a library that
// decodes an image, and system calls that wait for a disk. If the command has not ended kMaxStopS
// after the signal, a thread ends the process. This is as safe as a kill: builds resume, and no
// output has its final name before it is complete. Unlike a kill, the thread removes temporary
// files. A second signal ends the process immediately.
#pragma once

#include "voxdag/cancel_token.h"

namespace voxdag::cli {

inline constexpr double kMaxStopS = 0.5;

// Catches the signals for the rest of the process. `cancel` must outlive the process's threads.
void catch_signals(CancelToken& cancel);
// Lets the command take any time to stop after a signal, for servers that complete their answers.
void allow_slow_stop();

}  // namespace voxdag::cli
