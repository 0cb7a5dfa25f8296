# Warnings, sanitizers, ccache.

add_library(palpate_warnings INTERFACE)
target_compile_options(palpate_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wold-style-cast
  -Wnon-virtual-dtor -Woverloaded-virtual -Wcast-qual -Wformat=2 -Wimplicit-fallthrough)
if(PALPATE_WARNINGS_AS_ERRORS)
  target_compile_options(palpate_warnings INTERFACE -Werror)
endif()
if(PALPATE_SANITIZE)
  # GCC warns of uninitialised Eigen temporaries once the sanitizers change its inlining.
  target_compile_options(palpate_warnings INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  add_compile_options(-fsanitize=${PALPATE_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${PALPATE_SANITIZE})
endif()
if(PALPATE_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link)
endif()

find_program(PALPATE_CCACHE ccache)
if(PALPATE_CCACHE)
  set(CMAKE_C_COMPILER_LAUNCHER ${PALPATE_CCACHE})
  set(CMAKE_CXX_COMPILER_LAUNCHER ${PALPATE_CCACHE})
endif()

# No fused multiply-add behind our back: lockstep runs are equal to the bit on every build type.
add_compile_options(-ffp-contract=off)
