# SPDX-License-Identifier: Apache-2.0
# palpate_add_fuzz(NAME SOURCES a.cpp … LIBRARIES palpate::core … CORPUS folder)
#
# The sources define LLVMFuzzerTestOneInput(). With PALPATE_FUZZ (clang) the target is a libFuzzer
# program, `bin/NAME [options] NEW_INPUTS tests/fuzz/corpus/…`, and one ctest row runs it on the
# corpus. Without, the same sources become an ordinary test that replays the corpus. Label: fuzz.
function(palpate_add_fuzz name)
  cmake_parse_arguments(arg "" "CORPUS" "SOURCES;LIBRARIES" ${ARGN})
  get_filename_component(corpus ${arg_CORPUS} ABSOLUTE)
  if(PALPATE_FUZZ)
    add_executable(${name} ${arg_SOURCES})
    target_link_libraries(${name} PRIVATE ${arg_LIBRARIES} palpate_warnings)
    target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
    target_link_options(${name} PRIVATE -fsanitize=fuzzer)
    add_test(NAME ${name}_corpus COMMAND ${name} -runs=0 ${corpus})
    set_tests_properties(${name}_corpus PROPERTIES LABELS fuzz TIMEOUT 120)
  else()
    palpate_add_test(${name} SOURCES ${arg_SOURCES} ${PROJECT_SOURCE_DIR}/tests/fuzz/replay.cpp
                             LIBRARIES ${arg_LIBRARIES} LABELS fuzz)
    file(RELATIVE_PATH corpus ${PROJECT_SOURCE_DIR} ${corpus})
    target_compile_definitions(${name} PRIVATE PALPATE_FUZZ_CORPUS="${corpus}")
  endif()
endfunction()
