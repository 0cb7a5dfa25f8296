# cmake -DROOT=<source tree> -DRULES="folder:allowed,allowed;…" -P check_includes.cmake
# Fails if a source below `folder` includes a project header from a folder that is not allowed, or
# one of protobuf, ZeroMQ or spdlog where these are not allowed, or one of locks and threads in the
# nodes that run in the tick.

set(wire "^(palpate/v1/|foxglove/|google/protobuf/|zmq|spdlog/)")
set(locks "^(mutex|shared_mutex|condition_variable|semaphore|future|thread|pthread.h)$")
set(guarded "^(common|deploy|device_node|mofc_node|physics_node|tests|viewer_node)/|${wire}|${locks}")
set(violations "")
foreach(rule IN LISTS RULES)
  string(REGEX MATCH "^([^:]+):(.*)$" _ "${rule}")
  set(folder ${CMAKE_MATCH_1})
  string(REPLACE "," ";" allowed "${CMAKE_MATCH_2}")
  file(GLOB_RECURSE sources RELATIVE ${ROOT} ${ROOT}/${folder}/*.h ${ROOT}/${folder}/*.cpp)
  foreach(source IN LISTS sources)
    if(source MATCHES "/(main|process|recording|web_process)\\.(cpp|h)$")
      continue()
    endif()
    file(STRINGS ${ROOT}/${source} includes REGEX "^[ \t]*#[ \t]*include[ \t]*[\"<]")
    foreach(line IN LISTS includes)
      string(REGEX REPLACE "^[^\"<]*[\"<]([^\">]+)[\">].*" "\\1" header "${line}")
      # system headers pass, but for those of the project and of the wire
      if(line MATCHES "include[ \t]*<" AND NOT header MATCHES "${guarded}")
        continue()
      endif()
      set(is_allowed FALSE)
      foreach(prefix IN LISTS allowed)
        if(header MATCHES "^${prefix}/" AND NOT header MATCHES "\\.\\.")
          set(is_allowed TRUE)
        endif()
      endforeach()
      # the wire belongs to common/link and common/runtime
      if(header MATCHES "${wire}" AND folder MATCHES "^common/(link|runtime)$")
        set(is_allowed TRUE)
      endif()
      # the tick of the device, the clamp, and what they run on do not lock
      if(header MATCHES "${locks}" AND NOT folder MATCHES "^(common/core|device_node|mofc_node)")
        set(is_allowed TRUE)
      endif()
      if(NOT is_allowed)
        string(APPEND violations "\n  ${source}: includes \"${header}\"; ${folder} may include "
                                 "${allowed} only")
      endif()
    endforeach()
  endforeach()
endforeach()
if(violations)
  message(FATAL_ERROR "include boundaries (cmake/boundaries.cmake) are broken:${violations}")
endif()
