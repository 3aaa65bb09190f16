# A program that decodes an exported file with code that is not voxdag's, and prints a digest of all
# voxels. A test runs tests/long/exports_whole.py with this program on a small scene.
add_executable(digest_voxels export/whole/digest_voxels.cc export/whole/glb.cc export/whole/points.cc
                             export/whole/trees.cc export/whole/vox.cc)
target_link_libraries(digest_voxels PRIVATE voxdag_options nlohmann_json::nlohmann_json)
if(VOXDAG_VDB AND VOXDAG_NANOVDB_INCLUDE)
  target_sources(digest_voxels PRIVATE export/whole/nvdb.cc)
  target_compile_definitions(digest_voxels PRIVATE VOXDAG_HAS_NANOVDB)
  target_include_directories(digest_voxels SYSTEM PRIVATE ${VOXDAG_NANOVDB_INCLUDE})
endif()
if(VOXDAG_VDB AND VOXDAG_OPENVDB_INCLUDE AND VOXDAG_OPENVDB_LIBRARY AND VOXDAG_BOOST_INCLUDE)
  find_package(TBB QUIET)
  if(TBB_FOUND)
    target_sources(digest_voxels PRIVATE export/whole/vdb.cc)
    target_compile_definitions(digest_voxels PRIVATE VOXDAG_HAS_OPENVDB)
    target_include_directories(digest_voxels SYSTEM PRIVATE ${VOXDAG_OPENVDB_INCLUDE})
    target_link_libraries(digest_voxels PRIVATE ${VOXDAG_OPENVDB_LIBRARY} TBB::tbb)
  endif()
endif()
add_test(NAME export_whole
         COMMAND Python3::Interpreter ${PROJECT_SOURCE_DIR}/tests/long/exports_whole.py --resolution 128
                 --voxdag $<TARGET_FILE:voxdag> --digest $<TARGET_FILE:digest_voxels>)
set_tests_properties(export_whole PROPERTIES LABELS cli TIMEOUT 300)
