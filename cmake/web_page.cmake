# SPDX-License-Identifier: Apache-2.0
# palpate_web_page(OUT_FOLDER FILES_VARIABLE): index.html, app.js.gz and app.css.gz of the page in
# viewer_node/web, built by npm, or of a notice; report.js, report.css, stations.html and stations.js,
# empty without npm. viewer_node/server/build_page.cmake does the work.

set(PALPATE_WEB "AUTO" CACHE STRING "viewer_node's page, built by npm: AUTO (if it can be), ON or OFF")
set_property(CACHE PALPATE_WEB PROPERTY STRINGS AUTO ON OFF)

function(palpate_web_page out files)
  set(folder ${CMAKE_CURRENT_SOURCE_DIR}/web)
  set(notice ${CMAKE_CURRENT_SOURCE_DIR}/server/no_page.html)
  set(parts app.js.gz app.css.gz report.js report.css stations.html stations.js)
  list(TRANSFORM parts PREPEND ${out}/)
  set(results ${out}/index.html ${parts})
  set(${files} ${results} PARENT_SCOPE)
  file(MAKE_DIRECTORY ${out})

  find_program(PALPATE_NPM npm)
  find_program(PALPATE_GZIP gzip)
  set(can_build FALSE)
  if(PALPATE_NPM AND PALPATE_GZIP AND EXISTS ${folder}/package.json)
    set(can_build TRUE)
  endif()
  if(PALPATE_WEB STREQUAL "ON" AND NOT can_build)
    message(FATAL_ERROR "PALPATE_WEB=ON needs npm and gzip: apt-get install npm, or PALPATE_WEB=OFF")
  endif()
  if(PALPATE_WEB STREQUAL "OFF" OR NOT can_build)
    configure_file(${notice} ${out}/index.html COPYONLY)
    foreach(part IN LISTS parts)
      file(WRITE ${part} "")
    endforeach()
    return()
  endif()

  set(required OFF)
  if(PALPATE_WEB STREQUAL "ON")
    set(required ON)
  endif()
  set(script ${CMAKE_CURRENT_SOURCE_DIR}/server/build_page.cmake)
  list(TRANSFORM ARGN PREPEND ${folder}/ OUTPUT_VARIABLE sources)
  add_custom_command(OUTPUT ${results}
    COMMAND ${CMAKE_COMMAND} -DSOURCE=${folder} -DWORK=${CMAKE_CURRENT_BINARY_DIR}/web -DOUT=${out}
            -DNPM=${PALPATE_NPM} -DGZIP=${PALPATE_GZIP} -DREQUIRED=${required} -DNOTICE=${notice}
            -P ${script}
    DEPENDS ${sources} ${script} ${notice}
    COMMENT "Building the viewer's page" VERBATIM)
endfunction()
