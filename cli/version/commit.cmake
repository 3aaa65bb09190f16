# Writes OUTPUT, a source file with the commit of the folder SOURCE (commit.h). Changes the file only if the commit has
# changed, so that nothing is compiled again without a reason.
cmake_minimum_required(VERSION 3.22)
find_package(Git QUIET)
set(commit "")
if(GIT_FOUND AND EXISTS ${SOURCE}/.git)
  execute_process(COMMAND ${GIT_EXECUTABLE} -C ${SOURCE} describe --always --dirty --abbrev=12 --exclude=*
                  OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT
"#include \"cli/version/commit.h\"

const char* const voxdag::cli::kCommit = \"@commit@\";
" @ONLY)
