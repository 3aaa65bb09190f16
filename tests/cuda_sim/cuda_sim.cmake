# Compiles the CUDA backend's sources as C++ with the headers of the simulated device. Every memory
# access in these sources calls a function of the simulation. The option -fsanitize=thread inserts the
# calls. The library of this sanitizer is not linked, because the simulation replaces it. So builds
# with a sanitizer cannot contain the simulation.
if(VOXDAG_SANITIZE)
  return()
endif()
file(GLOB cuda_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/core/backend/cuda/*.cu)
file(GLOB simulation_sources CONFIGURE_DEPENDS cuda_sim/sim/*.cc)
set(program_sources cuda_sim/rules/programs.cc)
set_source_files_properties(${cuda_sources} ${program_sources} PROPERTIES LANGUAGE CXX COMPILE_OPTIONS
  "-x;c++;-include;cuda_runtime.h;-fsanitize=thread;-D__CUDA_ARCH__=900;-Wno-unknown-pragmas")
# A fortified longjmp() would reject jumps between the stacks of fibers.
set_source_files_properties(cuda_sim/sim/thread_blocks.cc PROPERTIES COMPILE_OPTIONS
  "-U_FORTIFY_SOURCE")
add_library(voxdag_cuda_sim STATIC ${cuda_sources} ${program_sources} ${simulation_sources})
target_include_directories(voxdag_cuda_sim BEFORE PUBLIC cuda_sim/include)
target_link_libraries(voxdag_cuda_sim PUBLIC voxdag_base voxdag_geometry voxdag_dag)

# Do not link voxdag_backend_parallel: the linker might choose its copies of the same inline functions,
# which do not call the simulation.
file(GLOB conformance_sources CONFIGURE_DEPENDS conformance/*.cc)
list(FILTER conformance_sources EXCLUDE REGEX "/(backends|cuda_test|large_grid_test)\\.cc$")
file(GLOB cuda_sim_tests CONFIGURE_DEPENDS cuda_sim/*.cc)
add_executable(test_cuda_sim ${conformance_sources} ${cuda_sim_tests})
target_link_libraries(test_cuda_sim PRIVATE voxdag_cuda_sim voxdag_backend_cpu voxdag_oracle
                      GTest::gmock GTest::gtest_main)
voxdag_compile_quickly(test_cuda_sim)
# The compiler uses the precompiled header of the other tests only if all definitions are the same.
target_compile_definitions(test_cuda_sim PRIVATE
  $<TARGET_PROPERTY:test_support,INTERFACE_COMPILE_DEFINITIONS>
  VOXDAG_SHARED_SCENES="${PROJECT_SOURCE_DIR}/../shared/scenes"
  VOXDAG_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
# The tests that take minutes on the simulated device run in tools/test-long.
set(long_tests "*AnyTriangles*:*ASplit*:*Reuse.*:*CountsAddUp*:*RegionsOfLargeCubes*")
foreach(method fast hashes pointers)
  gtest_discover_tests(test_cuda_sim DISCOVERY_TIMEOUT 60
    TEST_FILTER "*/cuda_sim_${method}-${long_tests}"
    PROPERTIES LABELS cuda_sim_${method} TIMEOUT 900)
endforeach()
gtest_discover_tests(test_cuda_sim DISCOVERY_TIMEOUT 60 TEST_FILTER "SimulatedDevice.*"
  PROPERTIES LABELS cuda_sim_fast TIMEOUT 900)

# Compiles the CUDA sources for the oldest and the newest architecture of the toolkit, and compares
# the resources of each kernel with recorded values.
if(VOXDAG_HAS_CUDA AND Python3_FOUND)
  add_test(NAME cuda_kernels COMMAND Python3::Interpreter ${PROJECT_SOURCE_DIR}/tools/check-kernels
                                     --nvcc ${CMAKE_CUDA_COMPILER})
  set_tests_properties(cuda_kernels PROPERTIES LABELS conformance TIMEOUT 900)
endif()

# Tests of complete builds, in which several workers use the simulated device.
add_executable(test_cuda_sim_builds cuda_sim/builds/whole_build_test.cc)
target_link_libraries(test_cuda_sim_builds PRIVATE voxdag_cuda_sim voxdag_scheduler voxdag_generate
                      test_support GTest::gmock GTest::gtest_main)
voxdag_compile_quickly(test_cuda_sim_builds)
target_compile_definitions(test_cuda_sim_builds PRIVATE
  VOXDAG_SHARED_SCENES="${PROJECT_SOURCE_DIR}/../shared/scenes"
  VOXDAG_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
gtest_discover_tests(test_cuda_sim_builds DISCOVERY_TIMEOUT 60
  PROPERTIES LABELS cuda_sim_fast TIMEOUT 900)
