# SPDX-License-Identifier: Apache-2.0
# cmake -DROOT=<source tree> -DOUTPUT=<header> -P commit.cmake
# Defines PALPATE_COMMIT as "+COMMIT", with ".changed" if files differ from it, or as "" outside a
# repository of git. The header is left alone if it says so already.
set(commit "")
execute_process(COMMAND git -C ${ROOT} rev-parse --show-toplevel
                OUTPUT_VARIABLE top OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE status)
if(status EQUAL 0 AND top STREQUAL ROOT)
  execute_process(COMMAND git -C ${ROOT} rev-parse --short=9 HEAD
                  OUTPUT_VARIABLE head OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE status)
  if(status EQUAL 0)
    set(commit "+${head}")
    execute_process(COMMAND git -C ${ROOT} diff --quiet HEAD -- RESULT_VARIABLE status)
    if(NOT status EQUAL 0)
      string(APPEND commit ".changed")
    endif()
  endif()
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT "#define PALPATE_COMMIT \"${commit}\"\n")
