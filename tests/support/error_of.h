#pragma once

#include <gtest/gtest.h>

#include "core/base/error.h"

namespace voxdag {

// The Error that `run` throws; a test failure, and an empty message, if it throws none.
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
