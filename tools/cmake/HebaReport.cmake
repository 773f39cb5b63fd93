# The script of heba's pages: TypeScript and packages from npm (tools/pages/web), one file within every page. Node.js is
# needed to build it and for nothing else.
set(HEBA_REPORT_SCRIPT "AUTO" CACHE STRING "Build charts into the pages: ON, OFF, or AUTO (if Node.js and npm's packages are to be had)")
set_property(CACHE HEBA_REPORT_SCRIPT PROPERTY STRINGS AUTO ON OFF)

# Sets `result` to 0 if the packages in `work` are there and run.
function(heba_probe_report_packages work result)
  execute_process(COMMAND ${HEBA_NODE} -e "require('esbuild').transformSync('')" WORKING_DIRECTORY ${work}
                  RESULT_VARIABLE status OUTPUT_QUIET ERROR_QUIET TIMEOUT 60)
  set(${result} "${status}" PARENT_SCOPE)
endfunction()

# Puts the packages that tools/pages/web/package-lock.json names into `work`; sets `why_not` to what is missing.
function(heba_install_report_packages source work why_not)
  set(${why_not} "" PARENT_SCOPE)
  if(NOT HEBA_REPORT_SCRIPT)
    set(${why_not} "HEBA_REPORT_SCRIPT is ${HEBA_REPORT_SCRIPT}" PARENT_SCOPE)
    return()
  endif()
  find_program(HEBA_NODE NAMES node nodejs)
  find_program(HEBA_NPM NAMES npm)
  if(NOT HEBA_NODE OR NOT HEBA_NPM)
    set(${why_not} "Node.js and npm are not installed" PARENT_SCOPE)
    return()
  endif()
  execute_process(COMMAND ${HEBA_NODE} -p "process.versions.node" OUTPUT_VARIABLE version OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  if(version VERSION_LESS 18)
    set(${why_not} "Node.js is '${version}', 18 or later is needed" PARENT_SCOPE)
    return()
  endif()
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${source}/package.json ${source}/package-lock.json)
  file(SHA256 ${source}/package-lock.json wanted)
  set(installed "")
  if(EXISTS ${work}/installed)
    file(READ ${work}/installed installed)
  endif()
  heba_probe_report_packages(${work} probe)
  if(installed STREQUAL wanted AND probe EQUAL 0)
    return()
  endif()
  file(MAKE_DIRECTORY ${work})
  file(REMOVE ${work}/installed)
  file(COPY ${source}/package.json ${source}/package-lock.json DESTINATION ${work})
  message(STATUS "Report: installing the packages of tools/pages/web with npm")
  # Whatever the user's npm leaves out otherwise: the bundler's binary is an optional package, the tests' are for
  # development. A registry that is out of reach costs seconds, not npm's usual minutes.
  execute_process(COMMAND ${HEBA_NPM} ci --ignore-scripts --no-audit --no-fund --include=dev --include=optional
                          --fetch-retries=1 --fetch-retry-mintimeout=2000 --fetch-timeout=60000
                  WORKING_DIRECTORY ${work} TIMEOUT 600
                  RESULT_VARIABLE status OUTPUT_VARIABLE said ERROR_VARIABLE said)
  heba_probe_report_packages(${work} probe)
  if(NOT status EQUAL 0 OR NOT probe EQUAL 0)
    string(REGEX MATCH "npm error[^\n]*" first "${said}")
    set(${why_not} "npm ci failed (${status}) ${first}" PARENT_SCOPE)
    return()
  endif()
  file(WRITE ${work}/installed ${wanted})
endfunction()

# heba_page_sources(out) sets `out` to a C++ source that defines tools/pages/page_assets.h; HEBA_HAS_REPORT_SCRIPT and
# HEBA_REPORT_WORK (the folder with the packages) tell the tests.
function(heba_page_sources out)
  set(source ${CMAKE_CURRENT_SOURCE_DIR}/pages/web)
  set(work ${CMAKE_CURRENT_BINARY_DIR}/report)
  heba_install_report_packages(${source} ${work} why_not)
  set(script "")
  set(hash "")
  if(why_not STREQUAL "")
    message(STATUS "Report: with charts")
    set(script ${work}/page.js)
    set(hash ${work}/page.hash)
    file(GLOB_RECURSE parts CONFIGURE_DEPENDS ${source}/src/*.ts)
    add_custom_command(OUTPUT ${script} ${hash}
      # The packages beside the sources, without anything written into the checkout.
      COMMAND ${CMAKE_COMMAND} -E rm -rf ${work}/src
      COMMAND ${CMAKE_COMMAND} -E copy_directory ${source}/src ${work}/src
      COMMAND ${CMAKE_COMMAND} -E copy ${source}/bundle.mjs ${source}/tsconfig.json ${work}
      COMMAND ${HEBA_NODE} bundle.mjs ${script} ${hash}
      WORKING_DIRECTORY ${work}
      DEPENDS ${parts} ${source}/bundle.mjs ${source}/tsconfig.json ${source}/package-lock.json VERBATIM)
  elseif(HEBA_REPORT_SCRIPT STREQUAL "OFF")
    message(STATUS "Report: plain, without charts")
  elseif(HEBA_REPORT_SCRIPT STREQUAL "ON")
    message(FATAL_ERROR "HEBA_REPORT_SCRIPT is ON, but ${why_not}")
  else()
    message(WARNING "heba's pages will be plain, without charts: ${why_not}")
  endif()
  set(assets ${CMAKE_CURRENT_BINARY_DIR}/page_assets.cc)
  add_custom_command(OUTPUT ${assets}
    COMMAND ${CMAKE_COMMAND} -DSTYLE=${source}/page.css -DSCRIPT=${script} -DHASH=${hash} -DOUT=${assets}
            -P ${PROJECT_SOURCE_DIR}/tools/cmake/EmbedPage.cmake
    DEPENDS ${source}/page.css ${script} ${hash} ${PROJECT_SOURCE_DIR}/tools/cmake/EmbedPage.cmake VERBATIM)
  set(${out} ${assets} PARENT_SCOPE)
  set(HEBA_HAS_REPORT_SCRIPT "${script}" CACHE INTERNAL "")
  set(HEBA_REPORT_WORK "${work}" CACHE INTERNAL "")
endfunction()
