# SPDX-License-Identifier: Apache-2.0
find_package(GTest REQUIRED)
include(GoogleTest)

# In one translation unit a local name may hide a name of another source.
add_library(palpate_test_warnings INTERFACE)
if(PALPATE_UNITY)
  target_compile_options(palpate_test_warnings INTERFACE -Wno-shadow)
endif()

# Labels of the tests that ctest runs: under a sanitizer those that need no real time.
set(labels_to_run ".")
# Optimisation of the sources of tests: half the compile time. What they test keeps that of its
# build type.
set(test_optimization -O1)
if(PALPATE_SANITIZE)
  set(labels_to_run "unit|property|lockstep|fuzz|sockets")
  set(test_optimization -O0)
endif()
# Their programs, and nothing that they do not need.
add_custom_target(tests_to_run)

# palpate_add_test(NAME SOURCES a.cpp … LIBRARIES palpate::core … LABELS unit [TIMEOUT s] [SERIAL])
#
# One executable, compiled as few translation units; every TEST of it is a ctest row with the labels.
# SERIAL rows use the real clock, sockets or processes and never run beside another row. Under a
# sanitizer all unit tests of an executable are one row: there a process takes longer to start than
# most tests to run.
function(palpate_add_test name)
  cmake_parse_arguments(arg "SERIAL" "TIMEOUT" "SOURCES;LIBRARIES;LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 900)  # for programs that hang; tests have limits of their own
  endif()
  if(PALPATE_SANITIZE)
    math(EXPR arg_TIMEOUT "4 * ${arg_TIMEOUT}")
  endif()
  list(GET arg_LABELS 0 first_label)
  set(properties LABELS ${first_label} TIMEOUT ${arg_TIMEOUT})
  if(arg_SERIAL)
    list(APPEND properties RUN_SERIAL ON)
  endif()
  add_executable(${name} ${arg_SOURCES})
  add_dependencies(${name} palpate_rivals)
  set_target_properties(${name} PROPERTIES UNITY_BUILD ${PALPATE_UNITY} UNITY_BUILD_BATCH_SIZE 8)
  target_link_libraries(${name} PRIVATE ${arg_LIBRARIES} GTest::gtest GTest::gmock GTest::gtest_main
                                        palpate::machine palpate_warnings palpate_test_warnings)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_options(${name} PRIVATE ${test_optimization})
  if(NOT "${arg_LABELS}" MATCHES "${labels_to_run}")
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
    return()
  endif()
  add_dependencies(tests_to_run ${name})
  if(PALPATE_SANITIZE AND arg_LABELS STREQUAL "unit")
    add_test(NAME ${name} COMMAND ${name})
    set_tests_properties(${name} PROPERTIES ${properties})
    return()
  endif()
  gtest_discover_tests(${name} NO_PRETTY_VALUES PROPERTIES ${properties} DISCOVERY_TIMEOUT 60)
  list(LENGTH arg_LABELS label_count)
  if(label_count GREATER 1)
    # gtest_discover_tests would take the second label for the name of a property
    set(labels ${CMAKE_CURRENT_BINARY_DIR}/${name}_labels.cmake)
    file(WRITE ${labels} "if(${name}_TESTS)\n"
                         "  set_tests_properties(\${${name}_TESTS} PROPERTIES LABELS \"${arg_LABELS}\")\n"
                         "endif()\n")
    set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${labels})
  endif()
endfunction()
