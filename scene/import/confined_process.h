// Runs a function in a child process whose address space is limited. A crash of the child, or a
// lack of memory there, becomes an Error in this process. The child is killed if this thread ends.
//
// The child is forked and does not start another program. So the caller must ensure that no other
// thread of this process holds a lock that the function needs.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "voxdag/cancel_token.h"

namespace voxdag {

// Sends a message to the parent.
using SendMessage = std::function<void(const nlohmann::json&)>;

// Calls work(send) in a child process, and receive(message) in this process for every message that
// `work` sends. Returns when the work has ended. `memory_bytes` is the address space that the child
// may use in addition to the address space that this process uses now. Messages of errors begin
// with `what`. Throws
//   - Errors of `work`; exceptions of `receive`, after killing the child;
//   - Error{kOutOfMemory} for std::bad_alloc in `work`, or if the system kills the child;
//   - Error{kInvalidInput} if the child crashes, or for other exceptions of `work`;
//   - Error{kCanceled} after cancel(), after killing the child;
//   - Error{kIo} if no process can be created.
void run_confined(const std::string& what, uint64_t memory_bytes,
                  const std::function<void(const SendMessage& send)>& work,
                  const std::function<void(const nlohmann::json& message)>& receive,
                  const CancelToken& cancel);

}  // namespace voxdag
