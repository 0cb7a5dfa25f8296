# SPDX-License-Identifier: Apache-2.0
# Warnings, sanitizers, ccache.

add_library(palpate_warnings INTERFACE)
if(PROJECT_IS_TOP_LEVEL)
  target_compile_options(palpate_warnings INTERFACE
    -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow
    $<$<COMPILE_LANGUAGE:CXX>:-Wold-style-cast> $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor>
    $<$<COMPILE_LANGUAGE:CXX>:-Woverloaded-virtual> -Wcast-qual -Wformat=2 -Wimplicit-fallthrough)
else()
  # none of these sources, nor of their headers, in the build of another project
  target_compile_options(palpate_warnings INTERFACE -w)
  set_property(DIRECTORY PROPERTY SYSTEM ON)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC 12 sees overlaps and overflows in std::string concatenation that are not there (GCC bugs
  # 105329, 105651).
  target_compile_options(palpate_warnings INTERFACE -Wno-restrict -Wno-array-bounds
                                                    -Wno-stringop-overflow)
endif()
if(PALPATE_WARNINGS_AS_ERRORS)
  target_compile_options(palpate_warnings INTERFACE -Werror)
endif()
if(PALPATE_SANITIZE)
  # GCC warns of uninitialised Eigen temporaries once the sanitizers change its inlining.
  target_compile_options(palpate_warnings INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  if(PALPATE_SANITIZE STREQUAL "thread" AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # ThreadSanitizer does not see the fences of Boost.Asio, and GCC warns of each.
    target_compile_options(palpate_warnings INTERFACE -Wno-tsan)
  endif()
  add_compile_options(-fsanitize=${PALPATE_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${PALPATE_SANITIZE})
  if(PALPATE_SANITIZE MATCHES "address")
    # These make compiling take 1.8 times as long. What a null or wild pointer reads or writes, the
    # address sanitizer reports.
    add_compile_options(-fno-sanitize=null,alignment,object-size,pointer-overflow)
  endif()
endif()
if(PALPATE_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link)
endif()

find_program(PALPATE_CCACHE ccache)
if(PALPATE_CCACHE)
  # the first is what ccache needs to cache a compilation with a precompiled header; by the others all
  # clones and worktrees share what is compiled
  set(launcher ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros
               CCACHE_BASEDIR=${PROJECT_SOURCE_DIR} CCACHE_NOHASHDIR=1 ${PALPATE_CCACHE})
  set(CMAKE_C_COMPILER_LAUNCHER ${launcher})
  set(CMAKE_CXX_COMPILER_LAUNCHER ${launcher})
  add_compile_options($<$<COMPILE_LANG_AND_ID:CXX,GNU>:-fpch-preprocess>)
endif()

# No fused multiply-add behind our back: lockstep runs are equal to the bit on every build type.
add_compile_options(-ffp-contract=off)

# For static libraries that shared ones are made of, too: nothing else changes, calls within a library
# stay calls within it.
function(palpate_position_independent)
  set_target_properties(${ARGN} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  foreach(target IN LISTS ARGN)
    target_compile_options(${target} PRIVATE -fno-semantic-interposition)
  endforeach()
endfunction()
