# cpack -G DEB makes a package for Debian 12 and its relatives: the program, the libraries with their headers, the Python
# module, the manual pages, the completions and the examples. tools/package.sh configures, builds and packs.
set(doc ${CMAKE_INSTALL_DATADIR}/doc/heba)
set(package_folder ${PROJECT_BINARY_DIR}/package)
find_program(GZIP gzip)

# Debian's copyright file and changelog.
file(MAKE_DIRECTORY ${package_folder})
file(WRITE ${package_folder}/copyright
"Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: heba

Files: *
Copyright: 2026 the authors of heba
License: Apache-2.0
 On Debian systems, the text of the licence is in /usr/share/common-licenses/Apache-2.0.
")
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
file(WRITE ${package_folder}/changelog
"heba (${PROJECT_VERSION}) unstable; urgency=medium

  * Version ${PROJECT_VERSION}; CHANGELOG.md beside this file has the changes.

 -- ${HEBA_MAINTAINER}  ${date}
")
if(GZIP)
  execute_process(COMMAND ${GZIP} -9nf ${package_folder}/changelog)
  install(FILES ${package_folder}/changelog.gz DESTINATION ${doc})
endif()
install(FILES ${package_folder}/copyright CHANGELOG.md README.md DESTINATION ${doc})
install(DIRECTORY docs/ DESTINATION ${doc}/manual FILES_MATCHING PATTERN "*.md" PATTERN "*.jpg" PATTERN "*.png")
install(DIRECTORY configs/ DESTINATION ${doc}/examples PATTERN "recorded" EXCLUDE)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME heba)
set(CPACK_PACKAGE_CONTACT ${HEBA_MAINTAINER})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION "hand-eye calibration of robot cameras by bundle adjustment
 heba finds where a camera is relative to a robot, from pictures of a target
 and the poses of the robot. It solves in closed form, refines everything by
 the reprojection error with the noise of the robot, says how good the result
 is, and writes files that ROS, OpenCV and the controllers of robots read. The
 package contains the program, the C++ libraries and the Python module.")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "libceres-dev, libeigen3-dev, libopencv-core-dev, libopencv-imgproc-dev, libopencv-calib3d-dev, libyaml-cpp-dev, nlohmann-json3-dev, libapriltag-dev, pkg-config, libcairo2-dev, libqrencode-dev, libpng-dev, libjpeg-dev, libtiff-dev, libxxhash-dev, zlib1g-dev, liburdfdom-dev")
if(HEBA_BUILD_PYTHON)
  string(REGEX MATCH "^([0-9]+)[.]([0-9]+)" python "${HEBA_PYTHON_VERSION}")
  math(EXPR next "${CMAKE_MATCH_2} + 1")
  set(CPACK_DEBIAN_PACKAGE_DEPENDS "python3 (>= ${python}), python3 (<< ${CMAKE_MATCH_1}.${next}), python3-numpy")
endif()
include(CPack)
