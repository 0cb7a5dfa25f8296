# SPDX-License-Identifier: Apache-2.0
# cmake -DSOURCE=<web folder> -DWORK=<folder> -DOUT=<folder> -DNPM=<npm> -DGZIP=<gzip>
#       -DREQUIRED=<ON|OFF> -DNOTICE=<html> -P build_page.cmake
# Builds the page in WORK and leaves index.html, app.js.gz, app.css.gz, report.js, report.css,
# stations.html and stations.js in OUT. If npm fails and the page is not REQUIRED, OUT gets the
# notice instead.

function(run)
  execute_process(COMMAND ${ARGN} WORKING_DIRECTORY ${WORK} RESULT_VARIABLE result
                  OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(result EQUAL 0)
    return()
  endif()
  if(REQUIRED)
    message(FATAL_ERROR "${ARGN} failed:\n${output}")
  endif()
  message(WARNING "the page could not be built, viewer_node gets a notice instead; ${ARGN}:\n${output}")
  set(failed TRUE PARENT_SCOPE)
endfunction()

file(COPY ${SOURCE}/ DESTINATION ${WORK} PATTERN node_modules EXCLUDE PATTERN dist EXCLUDE)
set(failed FALSE)

# the packages, as the lock file pins them; again only when it changed
file(SHA256 ${WORK}/package-lock.json lock)
set(stamp ${WORK}/node_modules/.palpate-${lock})
if(NOT EXISTS ${stamp})
  run(${NPM} ci --ignore-scripts --omit=dev --no-audit --no-fund)
  if(NOT failed)
    file(TOUCH ${stamp})
  endif()
endif()
if(NOT failed)
  run(${NPM} run build)
endif()

if(failed)
  configure_file(${NOTICE} ${OUT}/index.html COPYONLY)
  foreach(file app.js.gz app.css.gz report.js report.css stations.html stations.js)
    file(WRITE ${OUT}/${file} "")
  endforeach()
  return()
endif()
foreach(file index.html report.js report.css stations.html stations.js)
  configure_file(${WORK}/dist/${file} ${OUT}/${file} COPYONLY)
endforeach()
foreach(file app.js app.css)
  execute_process(COMMAND ${GZIP} -9nc ${WORK}/dist/${file} OUTPUT_FILE ${OUT}/${file}.gz
                  COMMAND_ERROR_IS_FATAL ANY)
endforeach()
