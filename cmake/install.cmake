# SPDX-License-Identifier: Apache-2.0
# What `cmake --install` puts where, and the Debian package: `cpack -G DEB` in the build folder. Without
# --component all; the component `programs` is what no other one is.
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME programs)
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# launch starts the nodes that lie beside it
install(TARGETS palpate palpate_tools device_node mofc_node device_mofc_node physics_node viewer_node)
if(PALPATE_ROS)
  install(TARGETS palpate_ros)
  install(TARGETS palpate_ros_device LIBRARY DESTINATION lib/palpate)
endif()
install(TARGETS palpate_rivals LIBRARY DESTINATION lib/palpate)
install(DIRECTORY deploy/campaigns deploy/sessions deploy/studies proto DESTINATION ${CMAKE_INSTALL_DATADIR}/palpate
        FILES_MATCHING PATTERN "*.txtpb" PATTERN "*.proto" PATTERN "*.msh" PATTERN "organ.ply"
        PATTERN "engines" EXCLUDE)
install(DIRECTORY deploy/audience DESTINATION ${CMAKE_INSTALL_DATADIR}/palpate USE_SOURCE_PERMISSIONS)
install(FILES README.md CHANGELOG.md THIRD_PARTY.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
# made by deploy/package.sh
install(FILES ${PROJECT_BINARY_DIR}/palpate.spdx.json DESTINATION ${CMAKE_INSTALL_DOCDIR} OPTIONAL)
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/docs)
install(FILES deploy/README.md DESTINATION ${CMAKE_INSTALL_DOCDIR}/deploy)
install(FILES deploy/systemd/README.md DESTINATION ${CMAKE_INSTALL_DOCDIR}/deploy/systemd)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright)
# printed by the build of deploy/palpate
set(pages ${PROJECT_BINARY_DIR}/deploy/palpate/pages)
install(DIRECTORY ${pages}/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 FILES_MATCHING PATTERN "*.1")
install(FILES ${pages}/palpate.bash RENAME palpate
        DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES ${pages}/_palpate DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions)
install(FILES ${pages}/palpate.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d)

# A shared library with a C header, its pkg-config file and its examples. The file is in share/, from
# where the prefix is two folders up whatever the library's folder is called.
function(palpate_install_library target component export folder)
  install(TARGETS ${target} EXPORT ${export}
          LIBRARY COMPONENT ${component} NAMELINK_COMPONENT ${component}
          PUBLIC_HEADER DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT ${component}
          INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  configure_file(${folder}/palpate_${component}.pc.in palpate_${component}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/palpate_${component}.pc
          DESTINATION ${CMAKE_INSTALL_DATADIR}/pkgconfig COMPONENT ${component})
  install(DIRECTORY ${folder}/examples/ COMPONENT ${component}
          DESTINATION ${CMAKE_INSTALL_DATADIR}/palpate/examples/${component})
  install(EXPORT ${export} NAMESPACE palpate:: DESTINATION ${package_folder}
          COMPONENT ${component})
  install(FILES ${package_files} DESTINATION ${package_folder} COMPONENT ${component})
endfunction()

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/palpate)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/palpateConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
set(package_files cmake/palpateConfig.cmake ${PROJECT_BINARY_DIR}/palpateConfigVersion.cmake)

# The controllers by themselves: cmake --install BUILD --component controllers --prefix FOLDER
install(TARGETS palpate_clamp palpate_controllers palpate_leaders EXPORT palpateTargets
        ARCHIVE COMPONENT controllers
        PUBLIC_HEADER DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/palpate/controllers
                      COMPONENT controllers
        INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
palpate_install_library(palpate_controllers_c controllers palpateTargets mofc_node/controllers)

# The tissue by itself: cmake --install BUILD --component tissue --prefix FOLDER
palpate_install_library(palpate_tissue_c tissue palpateTissue physics_node/library)
# for pip, which then finds the library that is installed
install(DIRECTORY physics_node/library/python/ COMPONENT tissue
        DESTINATION ${CMAKE_INSTALL_DATADIR}/palpate/python/tissue
        FILES_MATCHING PATTERN "*.py" PATTERN "*.toml" PATTERN "py.typed" PATTERN "build" EXCLUDE)

# To bring a physics of one's own: cmake --install BUILD --component physics --prefix FOLDER
install(FILES physics_node/sdk/physics.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/palpate
        COMPONENT physics)
install(FILES ${PROJECT_BINARY_DIR}/physics_node/libpalpate_physics.a
        DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT physics)
install(FILES ${package_files} cmake/palpatePhysics.cmake DESTINATION ${package_folder}
        COMPONENT physics)
install(DIRECTORY physics_node/sdk/examples DESTINATION ${CMAKE_INSTALL_DATADIR}/palpate
        COMPONENT physics)

# To bring a device of one's own: cmake --install BUILD --component devices --prefix FOLDER
install(FILES device_node/drivers/plugin/palpate_device.h
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/palpate COMPONENT devices)
install(FILES device_node/drivers/plugin/example_device.c
        DESTINATION ${CMAKE_INSTALL_DATADIR}/palpate/examples/devices COMPONENT devices)
install(DIRECTORY device_node/drivers/plugin/vendors
        DESTINATION ${CMAKE_INSTALL_DATADIR}/palpate/examples/devices COMPONENT devices)

# With MuJoCo and Bullet: cmake --install BUILD --component engines --prefix FOLDER
foreach(program mujoco_physics_node bullet_physics_node)
  if(TARGET ${program})
    install(TARGETS ${program} COMPONENT engines EXCLUDE_FROM_ALL)
  endif()
endforeach()
install(DIRECTORY deploy/sessions/engines DESTINATION ${CMAKE_INSTALL_DATADIR}/palpate/sessions
        COMPONENT engines EXCLUDE_FROM_ALL)

# The service: its files name /usr/bin and /etc/palpate.
option(PALPATE_SERVICE "Install the systemd units and /etc/palpate; for a package with prefix /usr" OFF)
if(PALPATE_SERVICE)
  install(DIRECTORY deploy/systemd/ DESTINATION lib/systemd/system FILES_MATCHING PATTERN "palpate*")
  install(FILES deploy/sessions/default.txtpb DESTINATION /etc/palpate)
  install(FILES deploy/udev/70-palpate.rules DESTINATION lib/udev/rules.d)
endif()

# Two packages: palpate, to run, and palpate-dev, to build against.
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/palpate-dev RENAME copyright
        COMPONENT devices)
set(CPACK_GENERATOR DEB)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL programs controllers tissue physics devices)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_COMPONENT_PROGRAMS_GROUP runtime)
foreach(component CONTROLLERS TISSUE PHYSICS DEVICES)
  set(CPACK_COMPONENT_${component}_GROUP dev)
endforeach()
set(CPACK_SET_DESTDIR ON)  # for /etc
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_CONTACT "The Palpate authors <palpate@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME palpate)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SECTION science)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_DEPENDS adduser)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SUGGESTS palpate-dev)
foreach(script conffiles postinst prerm postrm)
  list(APPEND CPACK_DEBIAN_RUNTIME_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/deploy/debian/${script})
endforeach()
set(CPACK_DEBIAN_DEV_PACKAGE_NAME palpate-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
# what an installed header or CMake package asks for; libpalpate_physics.a speaks the wire
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS
    "libeigen3-dev, libprotobuf-dev, libzmq3-dev, cppzmq-dev, libspdlog-dev")
set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS "palpate, cmake")
include(CPack)
