# Rules for `cpack`: the packages voxdag (the program, its manual, completions and the examples of the service) and
# libvoxdag-dev (the libraries with their headers). tools/make-deb makes them.

# dpkg-shlibdeps and file find the dependencies of a .deb. Without them the .deb would list none.
find_program(VOXDAG_SHLIBDEPS dpkg-shlibdeps)
find_program(VOXDAG_FILE_COMMAND file)
if(VOXDAG_SHLIBDEPS AND VOXDAG_FILE_COMMAND)
  set(CPACK_GENERATOR DEB)
else()
  message(STATUS "cpack makes archives, no .deb: dpkg-shlibdeps (dpkg-dev) or file is missing")
  set(CPACK_GENERATOR TGZ)
  set(CPACK_ARCHIVE_COMPONENT_INSTALL ON)
endif()
set(VOXDAG_PACKAGE_RELEASE "1" CACHE STRING
    "Revision of the Debian packages; tools/make-deb appends the name of the distribution")
set(CPACK_PACKAGE_CONTACT "the voxdag authors <voxdag@localhost>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL program service libraries)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE ${VOXDAG_PACKAGE_RELEASE})
# dpkg-shlibdeps derives the dependencies from the linked libraries.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# The packages contain no debug information, so they need no separate package of it.
set(CPACK_DEBIAN_DEBUGINFO_PACKAGE OFF)

set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME voxdag)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PROGRAMS_DESCRIPTION
"builds sparse voxel DAGs of huge triangle scenes
 voxdag converts triangle scenes (glTF, PLY, OBJ, STL) and point clouds into a
 sparse voxel DAG of up to 2^20 voxels per edge, exactly and out of core. It
 also shows, queries and exports these files, and can run as a service.")
# Clients check the certificates of a service.
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_RECOMMENDS ca-certificates)

# Programs that link voxdag::build or voxdag::query need the development packages of all libraries used.
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libvoxdag-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION
"libraries of voxdag for C++ and C
 The C++ libraries voxdag::build and voxdag::query, the C library libvoxdag, and
 the headers with which a program reads voxdag's files without a library.")
set(recommended pkg-config libssl-dev libzstd-dev libxxhash-dev libsqlite3-dev nlohmann-json3-dev)
if(VOXDAG_IMAGES)
  list(APPEND recommended libpng-dev libjpeg-dev)
endif()
list(TRANSFORM optional_decoders APPEND -dev)
list(APPEND recommended ${optional_decoders})
if(VOXDAG_DRACO_ARCHIVE)
  list(APPEND recommended libdraco-dev)
endif()
if(VOXDAG_MESHOPT_LIBRARY)
  list(APPEND recommended libmeshoptimizer-dev)
endif()
list(JOIN recommended ", " recommended)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_RECOMMENDS "${recommended}")

include(CPack)
cpack_add_component_group(programs)
cpack_add_component_group(development)
cpack_add_component(program GROUP programs)
cpack_add_component(service GROUP programs)
cpack_add_component(libraries GROUP development)
