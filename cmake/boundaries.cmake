# Who may know whom. The clamp must not see the physics, the simulated device or the true state, and
# no node library sees a socket: both are checked, at configure time (links) and on every build
# (includes), and a violation stops the build.

# Folder → folders its sources may include from. main.cpp and
# process.* are exempt: they connect a node to the world.
set(PALPATE_BOUNDARIES
  "common/core:common/core"
  "common/link:common/core,common/link"
  "common/runtime:common/core,common/link,common/runtime"
  "device_node:common/core,device_node"
  "mofc_node/controllers:mofc_node/controllers"
  "mofc_node:common/core,mofc_node"
  "physics_node:common/core,physics_node"
  "viewer_node:common/core,viewer_node")

# Every library a target links to, directly or not.
function(palpate_links_of target result)
  set(seen "")
  set(queue ${target})
  while(queue)
    list(POP_FRONT queue item)
    string(REGEX REPLACE "^\\$<LINK_ONLY:(.*)>$" "\\1" item "${item}")
    if(item IN_LIST seen)
      continue()
    endif()
    list(APPEND seen ${item})
    if(TARGET ${item})
      get_target_property(aliased ${item} ALIASED_TARGET)
      if(aliased)
        list(APPEND queue ${aliased})
      endif()
      foreach(property LINK_LIBRARIES INTERFACE_LINK_LIBRARIES)
        get_target_property(links ${item} ${property})
        if(links)
          list(APPEND queue ${links})
        endif()
      endforeach()
    endif()
  endwhile()
  set(${result} ${seen} PARENT_SCOPE)
endfunction()

function(palpate_forbid_links target)
  palpate_links_of(${target} links)
  foreach(forbidden IN LISTS ARGN)
    if(forbidden IN_LIST links)
      message(FATAL_ERROR "${target} links ${forbidden}: the boundary of cmake/boundaries.cmake "
                          "forbids it. Take the link out; if ${target} needs data from there, "
                          "put it into a message of common/core/messages.h.")
    endif()
  endforeach()
endfunction()

function(palpate_check_boundaries)
  set(sockets palpate_link palpate_runtime palpate_proto protobuf::libprotobuf cppzmq spdlog::spdlog)
  palpate_forbid_links(palpate_controllers palpate_core physics_node_lib device_node_lib
                       viewer_node_lib ${sockets})
  palpate_forbid_links(mofc_node_lib physics_node_lib device_node_lib viewer_node_lib ${sockets})
  palpate_forbid_links(physics_node_lib mofc_node_lib palpate_controllers device_node_lib
                       viewer_node_lib ${sockets})
  palpate_forbid_links(device_node_lib mofc_node_lib palpate_controllers physics_node_lib
                       viewer_node_lib ${sockets})

  list(JOIN PALPATE_BOUNDARIES ";" rules)
  add_custom_target(include_boundaries ALL
    COMMAND ${CMAKE_COMMAND} "-DROOT=${CMAKE_SOURCE_DIR}" "-DRULES=${rules}"
            -P ${CMAKE_SOURCE_DIR}/cmake/check_includes.cmake
    COMMENT "Checking who includes whom" VERBATIM)
endfunction()
