# SPDX-License-Identifier: Apache-2.0
# Which folder may include from which. The clamp must not see the physics, the simulated device or
# the true state, and no node library sees a socket. Checked on every build (includes) and at
# configure time (links); a violation stops the build.

# "folder:allowed,…" for the sources of that folder, its subfolders excluded where they have a rule
# of their own. An allowed entry is
#   a folder    its headers, not those of its subfolders
#   folder/*    its headers and those of its subfolders
#   a header
#   @wire       protobuf's generated headers      @zmq  ZeroMQ      @log  spdlog
#   @cli        the command line
#   @dds        Cyclone DDS, and the messages of ROS 2 as it generates them
#   @threads    locks and threads, which the tick must not know
# Every folder may include its own headers. main.* and process.* are exempt: they connect a node to
# the world.
set(PALPATE_BOUNDARIES
  # core ← contact, session ← telemetry ← link ← process
  # coupling: Eigen only, installed with the controllers
  "common/coupling:"
  "common/core:common/coupling,common/core/elastic,commit.h"
  "common/core/elastic:common/core"
  "common/core/user:common/core"
  "common/contact:common/core"
  "common/contact/tiles:common/core,common/contact,common/contact/cloud"
  "common/contact/cloud:common/core,common/contact"
  "common/contact/elastic:common/core"
  "common/session:common/core"
  "common/session/file:common/core,common/core/user,common/session,@wire"
  "common/session/file/task:common/core,common/session,common/session/file,@wire"
  "common/session/file/tissue:common/core,common/core/user,common/session,common/session/file,@wire"
  "common/session/file/tool:common/core,common/session,common/session/file,@wire"
  "common/session/reference:common/session/file,@wire"
  "common/telemetry:common/core,common/core/user,common/session,common/telemetry/verdict,@log,@threads"
  "common/telemetry/verdict:common/core,common/session,common/telemetry,@log"
  "common/task:common/core,common/core/user,common/contact,common/session,common/telemetry,@log"
  # in link: codec, security ← socket ← the ends
  "common/link/codec:common/core,common/core/elastic,common/coupling,common/telemetry,@wire"
  "common/link/security:common/core,common/core/user,@zmq,@threads"
  "common/link/socket:common/core,common/core/user,common/session,common/link/codec,common/link/security,@zmq,@threads"
  "common/link:common/core,common/telemetry,common/link/*,@zmq"
  "common/process:common/core,common/core/user,common/session,common/telemetry,common/link/*,@log,@cli,@threads"

  # the tick knows the interface of a device, no driver and no simulation
  "device_node:common/core,common/session/device_config.h,common/session/device_profile.h,common/telemetry/device_telemetry.h,device_node/monitor"
  # the monitor of the energy shares nothing with the clamp that it watches
  "device_node/monitor:common/core,common/session/device_config.h,common/session/device_profile.h"
  # the friction of a device, measured without a hand
  "device_node/identification:common/core,common/session/device_profile.h,device_node/device.h,device_node/release.h"
  # what drivers are checked for: the interface of a device, and the check that enables one
  "device_node/conformance:common/core,common/session/device_profile.h,device_node/device.h,device_node/motor_check.h,@log"
  "device_node/simulation:common/core,common/session/simulation_config.h,device_node/device.h,device_node/reading_observer.h"
  # simulation ← drivers, one folder a driver; they wait while they open a device, never in the tick
  "device_node/drivers:common/core,common/session/driver_config.h,device_node/device.h,device_node/drivers/*,@threads"
  "device_node/drivers/transport:common/core"
  # leader arms: a library of their own, without sessions
  "device_node/drivers/leader:common/core,device_node/drivers/transport,@threads"
  "device_node/drivers/leader/c:device_node/drivers/damiao,device_node/drivers/dynamixel,device_node/drivers/leader"
  # installed into one folder with leader.h, which they name without its own
  "device_node/drivers/damiao:common/core,device_node/drivers/leader,device_node/drivers/transport,leader.h"
  "device_node/drivers/dynamixel:common/core,device_node/drivers/leader,device_node/drivers/transport,leader.h"
  "device_node/drivers/falcon:common/core,common/session/driver_config.h,device_node/device.h,device_node/drivers,device_node/drivers/transport,@threads"
  "device_node/drivers/haply:common/core,common/session/driver_config.h,device_node/device.h,device_node/drivers,device_node/drivers/transport,@threads"
  "device_node/drivers/hapi:common/core,common/session/driver_config.h,device_node/device.h,device_node/drivers,device_node/drivers/transport"
  "device_node/drivers/wooden:common/core,common/session/driver_config.h,device_node/device.h,device_node/drivers,device_node/drivers/transport,@threads"
  "device_node/drivers/plugin:common/core,common/session/driver_config.h,device_node/device.h,device_node/drivers"
  # installed beside palpate_device.h, and built without the rest
  "device_node/drivers/plugin/vendors:palpate_device.h"
  # what stands in for a device at the other end of its wire
  "device_node/emulators:common/core,common/session/driver_config.h,common/session/simulation_config.h,device_node/simulation,device_node/drivers/*,@threads"
  "device_node/drivers/simulated:common/core,common/session/simulation_config.h,device_node/device.h,device_node/simulation"

  # the clamp knows its own part of the session and no true state
  "mofc_node:common/core,common/coupling,common/contact,common/session/clamped_device.h,common/session/device_profile.h,common/session/mofc_config.h,common/session/rivals_config.h,common/telemetry/mofc_telemetry.h,common/telemetry/metrics.h,mofc_node/controllers,mofc_node/controllers/named,mofc_node/controllers/ports,mofc_node/failover,mofc_node/tissue"
  "mofc_node/failover:common/core,common/contact,mofc_node/tissue"
  "mofc_node/tissue:common/core,common/core/elastic,common/contact,common/contact/tiles,common/contact/elastic"
  "mofc_node/controllers:wave_channel.h"
  # installed into one folder with the headers of controllers/, which it names without theirs
  "mofc_node/controllers/rivals:mofc_node/controllers,force_controller.h,guard_mofc.h,implicit_step.h,wave_channel.h"
  # several ports of any units: not the forces and positions of the three-axis loop
  "mofc_node/controllers/ports:energy_count.h,leak_gate.h,lease_rule.h,mofc_equations.h"
  "mofc_node/controllers/named:mofc_node/controllers/ports,mofc_node/controllers/rivals,axis_friction.h,force_controller.h,guard_mofc.h,own_controllers.h,paper_mofc.h,safety_net.h,vector_mofc.h"
  # a project of its own, against stubs
  "mofc_node/controllers/examples:"

  # surfaces ← files ← scene ← display; the step sees the scene only, and no lock
  # foreign: an engine from elsewhere, of which the scene knows nothing ← engine_process
  "physics_node/foreign:common/core,common/contact,common/session,physics_node,physics_node/display/display.h,physics_node/sdk/physics.h,@threads"
  "physics_node/sdk:"
  "physics_node/engine_process:common/*,physics_node,physics_node/answer,physics_node/display/display.h,physics_node/foreign,physics_node/sdk/physics.h,@log,@cli"
  "physics_node/engines/bullet:physics_node/sdk/physics.h"
  "physics_node/engines/mujoco:physics_node/sdk/physics.h"
  "physics_node:common/core,common/coupling,common/contact,common/session/scene_config.h,common/telemetry/physics_telemetry.h,physics_node/answer,physics_node/library,physics_node/scene,physics_node/elastic_tissue,physics_node/elastic_tissue/patch"
  # what hop 3 carries of a step: models, descriptions, waves, and when
  "physics_node/answer:common/core,common/coupling,common/contact,common/session/scene_config.h,physics_node/scene"
  "physics_node/surfaces:common/core,common/contact,common/contact/cloud,common/session/scene_config.h,@threads"
  # elastic bodies by themselves: linear ← elastic; no session, no wire
  "physics_node/elastic:common/core,common/contact/elastic,common/contact/tissue_motion.h,physics_node/elastic/*,@threads"
  "physics_node/elastic/contact:common/core,common/contact/surface.h,common/contact/tissue_motion.h,physics_node/elastic,physics_node/elastic/condensed"
  "physics_node/elastic/linear:common/contact/elastic/clones.h,physics_node/elastic/mesh.h"
  "physics_node/files:common/core,common/core/user,common/contact,common/session/scene_config.h,physics_node/surfaces,@threads"
  "physics_node/scene:common/core,common/contact,common/contact/tiles,common/session/scene_config.h,physics_node/surfaces,physics_node/files"
  "physics_node/elastic_tissue:common/core,common/core/elastic,common/contact,common/contact/elastic,common/session/scene_config.h,common/telemetry/physics_telemetry.h,physics_node/surfaces,physics_node/files,physics_node/scene,physics_node/elastic,physics_node/elastic/attached,physics_node/elastic/condensed,physics_node/elastic/contact,physics_node/elastic/cut,physics_node/elastic/grip,physics_node/elastic_tissue/ablation,physics_node/elastic_tissue/blade,physics_node/elastic_tissue/needle,physics_node/elastic_tissue/patch,physics_node/elastic_tissue/touching,@threads,physics_node/elastic_tissue/attached"
  "physics_node/elastic_tissue/attached:common/core,common/contact,common/session/scene_config.h,physics_node/elastic,physics_node/surfaces,physics_node/files,physics_node/elastic_tissue"
  "physics_node/elastic_tissue/touching:common/core,common/contact,common/session/scene_config.h,physics_node/surfaces,physics_node/files,physics_node/elastic,physics_node/elastic/contact,physics_node/elastic_tissue,physics_node/elastic/attached,physics_node/elastic/condensed,physics_node/elastic_tissue/attached"
  "physics_node/elastic_tissue/patch:common/core,common/core/elastic,physics_node/elastic,physics_node/elastic/condensed,physics_node/elastic_tissue"
  "physics_node/elastic_tissue/needle:common/core,common/session/scene_config.h,physics_node/elastic_tissue"
  "physics_node/elastic_tissue/ablation:common/core,common/session/scene_config.h,physics_node/elastic,physics_node/elastic/attached,physics_node/elastic/cut,physics_node/elastic_tissue,physics_node/elastic_tissue/patch,@threads"
  "physics_node/elastic_tissue/blade:common/core,common/session/scene_config.h,physics_node/elastic/cut,physics_node/elastic_tissue,physics_node/elastic_tissue/ablation"
  # the tissue by itself: in physics_node, and without processes; installed with its C interface
  "physics_node/library:common/core,common/contact,common/session,physics_node/files,physics_node/scene,physics_node/elastic_tissue,physics_node/display/display_mesh.h,@threads"
  "physics_node/library/examples:palpate_tissue.h,palpate_tissue.hpp"
  "physics_node/display:common/core,common/contact,common/session,common/telemetry,physics_node/surfaces,physics_node/files,physics_node/scene,physics_node/elastic_tissue"

  # feed ← recording, server ← process (the files of viewer_node itself)
  "viewer_node/openigtlink:common/core,common/link,common/process,common/session,common/telemetry,viewer_node/feed,@log"
  "viewer_node:common/*,viewer_node/audience,viewer_node/feed,viewer_node/live,viewer_node/openigtlink,viewer_node/recording,viewer_node/server,viewer_node/task,@log"
  "viewer_node/live:common/*,viewer_node/audience,viewer_node/feed,viewer_node/recording,viewer_node/server,viewer_node/task,@log"
  "viewer_node/audience:common/*,viewer_node/live/channels.h,viewer_node/feed,viewer_node/server,@zmq,@threads"
  "viewer_node/feed:common/core,common/core/user,common/session,common/telemetry"
  "viewer_node/recording/html:common/core/user"
  "viewer_node/recording:common/*,viewer_node/feed,viewer_node/recording/html,@log,@threads"
  "viewer_node/task:common/*,viewer_node/feed,viewer_node/recording,viewer_node/recording/html,@log"
  "viewer_node/server:common/core,common/core/user,@threads"

  # lockstep ← campaign; launch ← conform; campaign, conform ← palpate
  "deploy/lockstep:common/*,device_node/*,mofc_node/*,physics_node/*,viewer_node/feed,viewer_node/recording,@zmq,@log,@threads"
  "deploy/campaign:common/*,deploy/lockstep,mofc_node/make_controller.h,@wire,@log,@threads"
  # trials of a session under several conditions; who runs them is palpate
  "deploy/study:common/core,common/core/user,common/session,common/task,common/telemetry,deploy/campaign,@wire,@log"
  # from a segmentation to a mesh: no session, no wire
  "deploy/scan:common/core,common/core/user,common/contact,physics_node/surfaces,physics_node/files,physics_node/elastic"
  "deploy/launch:common/*,@log,@threads"
  "deploy/conform:common/*,deploy/launch,device_node/device.h,device_node/release.h,device_node/conformance,device_node/drivers,device_node/simulation/hand.h,@log,@zmq,@threads"
  # topics of ROS 2: dds ← viewer, physics, device; nobody includes from there
  "deploy/ros:common/core,common/process,deploy/ros/*,physics_node/engine_process,@cli"
  "deploy/ros/rosbridge:common/core,common/telemetry,@threads"
  "deploy/ros/dds:common/core,deploy/ros/rosbridge,@dds"
  "deploy/ros/viewer:common/core,common/link,common/process,common/session,common/telemetry,deploy/ros/dds,viewer_node,viewer_node/feed,viewer_node/task,@log"
  "deploy/ros/device:common/core,common/process,common/session,common/telemetry,deploy/ros/dds,device_node/drivers/plugin,@log,@threads"
  "deploy/ros/physics:common/core,common/process,common/session,common/telemetry,deploy/ros/dds,physics_node,physics_node/engine_process,physics_node/foreign,physics_node/sdk/physics.h,@log,@threads"
  "deploy/palpate:common/*,deploy/palpate/*,deploy/scan,deploy/lockstep,deploy/campaign,deploy/study,deploy/launch,deploy/conform,device_node/*,physics_node/*,viewer_node/process.h,viewer_node/feed,viewer_node/recording,viewer_node/task,@log,@cli,@threads"
  # its page has a server of its own
  "deploy/palpate/stations:common/*,deploy/palpate,viewer_node/server,@log,@cli,@threads")

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
  set(sockets palpate_link palpate_process palpate_session_file palpate_telemetry_output palpate_proto
              protobuf::libprotobuf cppzmq spdlog::spdlog)
  set(truth device_simulation device_drivers)
  set(viewers viewer_feed viewer_recording viewer_server)
  palpate_forbid_links(palpate_controllers palpate_core palpate_contact palpate_session
                       palpate_telemetry device_node_lib physics_node_lib ${truth} ${viewers} ${sockets})
  palpate_forbid_links(mofc_node_lib palpate_controllers physics_node_lib device_node_lib ${truth} ${viewers} ${sockets})
  palpate_forbid_links(palpate_tissue mofc_node_lib palpate_clamp device_node_lib physics_node_lib physics_loop
                       ${truth} ${viewers} ${sockets})
  palpate_forbid_links(palpate_tissue_c mofc_node_lib palpate_clamp device_node_lib physics_node_lib
                       physics_loop ${truth} ${viewers} palpate_link palpate_process
                       palpate_telemetry_output cppzmq spdlog::spdlog)
  palpate_forbid_links(mofc_node palpate_controllers)  # those of others are loaded
  palpate_forbid_links(device_mofc_node palpate_controllers)
  palpate_forbid_links(physics_node_lib mofc_node_lib palpate_clamp device_node_lib ${truth}
                       ${viewers} ${sockets})
  palpate_forbid_links(device_node_lib mofc_node_lib palpate_clamp physics_node_lib ${truth}
                       ${viewers} ${sockets})
  palpate_forbid_links(device_simulation device_node_lib mofc_node_lib palpate_clamp
                       physics_node_lib ${viewers} ${sockets})
  palpate_forbid_links(viewer_feed mofc_node_lib palpate_clamp device_node_lib physics_node_lib
                       ${truth} ${sockets})
  palpate_forbid_links(viewer_server mofc_node_lib palpate_clamp device_node_lib
                       physics_node_lib ${truth} ${sockets})
  foreach(program IN ITEMS palpate palpate_tools device_node mofc_node device_mofc_node physics_node
                           viewer_node)
    palpate_forbid_links(${program} palpate_dds)  # sessions without ROS load nothing of DDS
  endforeach()

  list(JOIN PALPATE_BOUNDARIES ";" rules)
  add_custom_target(include_boundaries ALL
    COMMAND ${CMAKE_COMMAND} "-DROOT=${PROJECT_SOURCE_DIR}" "-DRULES=${rules}"
            -P ${PROJECT_SOURCE_DIR}/cmake/check_includes.cmake
    COMMENT "Checking who includes whom" VERBATIM)
endfunction()
