# SPDX-License-Identifier: Apache-2.0
# palpate::physics: <palpate/physics.h> and one archive. Its libraries are Debian packages.
if(TARGET palpate::physics)
  return()
endif()
find_dependency(Protobuf)
find_dependency(cppzmq)
find_dependency(spdlog)
find_dependency(Threads)
get_filename_component(palpate_library "${CMAKE_CURRENT_LIST_DIR}/../.." ABSOLUTE)
# lib/cmake/palpate, or lib/x86_64-linux-gnu/cmake/palpate
find_path(palpate_include palpate/physics.h REQUIRED NO_CACHE NO_DEFAULT_PATH
          PATHS ${palpate_library}/../include ${palpate_library}/../../include)
add_library(palpate::physics STATIC IMPORTED)
set_target_properties(palpate::physics PROPERTIES
  IMPORTED_LOCATION ${palpate_library}/libpalpate_physics.a
  INTERFACE_INCLUDE_DIRECTORIES ${palpate_include}
  INTERFACE_COMPILE_FEATURES cxx_std_20
  INTERFACE_LINK_LIBRARIES
    "Eigen3::Eigen;protobuf::libprotobuf;cppzmq;spdlog::spdlog;Threads::Threads")
