#pragma once

#include <gtest/gtest.h>

#include "core/base/error.h"

namespace voxdag {

// Calls `run` and returns the Error that it throws. If it throws none, the test fails, and the
// message of the returned Error is empty.
template <class Run>
Error error_of(Run run) {
  try {
    run();
  } catch (const Error& error) {
    return error;
  }
  ADD_FAILURE() << "expected an Error";
  return Error(ErrorCode::kIo, "");
}

}  // namespace voxdag
