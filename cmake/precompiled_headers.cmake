# SPDX-License-Identifier: Apache-2.0
# Precompiled headers for every target of the project: without, much of the compile time goes into
# parsing Eigen, spdlog and GoogleTest again and again. Each target takes the set that fits
# what it links. CLI11 is in none of them: its header defines objects, which every source that sees
# it constructs. -DPALPATE_PRECOMPILE=OFF builds without, as a check that every file includes what
# it uses.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  set(precompile_default ON)
else()
  set(precompile_default OFF)
endif()
option(PALPATE_PRECOMPILE "Use precompiled headers" ${precompile_default})

set(PALPATE_COMMON_HEADERS
  <algorithm> <array> <atomic> <chrono> <cmath> <cstdint> <filesystem> <functional> <memory>
  <optional> <span> <string> <string_view> <variant> <vector> <Eigen/Core> <Eigen/Geometry>)

# A target that only holds a precompiled header for others.
function(palpate_add_header_set name)
  cmake_parse_arguments(arg "" "" "HEADERS;LIBRARIES;OPTIONS" ${ARGN})
  file(WRITE ${PROJECT_BINARY_DIR}/${name}.cpp "")
  add_library(${name} STATIC ${PROJECT_BINARY_DIR}/${name}.cpp)
  # with the warnings: -Wpedantic changes which macros are predefined
  target_link_libraries(${name} PRIVATE ${arg_LIBRARIES} palpate_warnings)
  target_compile_options(${name} PRIVATE ${arg_OPTIONS})
  target_precompile_headers(${name} PRIVATE ${PALPATE_COMMON_HEADERS} ${arg_HEADERS})
endfunction()

# All targets of a folder and below.
function(palpate_targets_of folder result)
  get_property(targets DIRECTORY ${folder} PROPERTY BUILDSYSTEM_TARGETS)
  get_property(folders DIRECTORY ${folder} PROPERTY SUBDIRECTORIES)
  foreach(below IN LISTS folders)
    palpate_targets_of(${below} more)
    list(APPEND targets ${more})
  endforeach()
  set(${result} ${targets} PARENT_SCOPE)
endfunction()

# To be called when all targets are known.
function(palpate_precompile_headers)
  if(NOT PALPATE_PRECOMPILE)
    return()
  endif()
  palpate_targets_of(${PROJECT_SOURCE_DIR} targets)
  # tests have a set of their own: a precompiled header fits one level of optimisation only
  palpate_add_header_set(node_headers LIBRARIES Eigen3::Eigen)
  palpate_add_header_set(library_headers LIBRARIES Eigen3::Eigen)
  palpate_position_independent(library_headers)
  palpate_add_header_set(process_headers
    HEADERS <spdlog/spdlog.h>
    LIBRARIES Eigen3::Eigen spdlog::spdlog)
  if(PALPATE_BUILD_TESTS)
    palpate_add_header_set(test_headers
      HEADERS <gtest/gtest.h> <gmock/gmock.h>
      LIBRARIES Eigen3::Eigen GTest::gtest GTest::gmock OPTIONS ${test_optimization})
  endif()
  foreach(target IN LISTS targets)
    get_target_property(type ${target} TYPE)
    get_target_property(options ${target} COMPILE_OPTIONS)
    get_target_property(is_library ${target} POSITION_INDEPENDENT_CODE)
    if(NOT type MATCHES "^(STATIC_LIBRARY|EXECUTABLE)$" OR target MATCHES "^palpate_(proto|controllers|clamp|leaders|version)$")
      continue()
    endif()
    palpate_links_of(${target} links)
    if("GTest::gtest" IN_LIST links AND "${test_optimization}" IN_LIST options)
      set(headers test_headers)
    elseif("-O0" IN_LIST options)
      continue()  # none of the others fits
    elseif("spdlog::spdlog" IN_LIST links)
      set(headers process_headers)
    elseif(is_library)
      set(headers library_headers)
    elseif("Eigen3::Eigen" IN_LIST links)
      set(headers node_headers)
    else()
      continue()
    endif()
    target_precompile_headers(${target} REUSE_FROM ${headers})
  endforeach()
endfunction()
