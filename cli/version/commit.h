// The commit of the sources. commit.cmake writes the source file that defines kCommit.
#pragma once

namespace voxdag::cli {

extern const char* const kCommit;  // empty for sources that are not in a Git repository

}  // namespace voxdag::cli
