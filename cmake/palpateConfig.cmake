# SPDX-License-Identifier: Apache-2.0
# find_package(palpate)                       palpate::controllers
# find_package(palpate COMPONENTS physics)    palpate::physics
# find_package(palpate COMPONENTS tissue)     palpate::tissue; several may be named
include(CMakeFindDependencyMacro)
set(palpate_controllers_file palpateTargets.cmake)
set(palpate_physics_file palpatePhysics.cmake)
set(palpate_tissue_file palpateTissue.cmake)
set(palpate_components ${palpate_FIND_COMPONENTS})
if(NOT palpate_components)
  set(palpate_components controllers)
  set(palpate_FIND_REQUIRED_controllers TRUE)
endif()
foreach(component IN LISTS palpate_components)
  set(file ${CMAKE_CURRENT_LIST_DIR}/${palpate_${component}_file})
  if(palpate_${component}_file AND EXISTS ${file})
    if(NOT component STREQUAL "tissue")
      find_dependency(Eigen3)
    endif()
    include(${file})
    set(palpate_${component}_FOUND TRUE)
  elseif(palpate_FIND_REQUIRED_${component})
    set(palpate_FOUND FALSE)
    set(palpate_NOT_FOUND_MESSAGE
        "palpate: component ${component} is not installed here; there are controllers, tissue and physics, "
        "each installed by: cmake --install BUILD --component NAME --prefix FOLDER")
  endif()
endforeach()
