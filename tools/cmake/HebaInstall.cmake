# cmake --install gives a find_package(heba) package and the program. The package has one component for each library, so
# that a consumer needs the packages of the components that it names only.
include(CMakePackageConfigHelpers)
set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/heba)
get_property(components GLOBAL PROPERTY HEBA_LIBRARIES)
set(builds_on "")
foreach(component IN LISTS components)
  get_property(others GLOBAL PROPERTY HEBA_${component}_BUILDS_ON)
  string(APPEND builds_on "set(heba_${component}_builds_on ${others})\n")
  install(TARGETS heba_${component} EXPORT heba_${component}_export
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
          FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(EXPORT heba_${component}_export NAMESPACE heba:: FILE heba_${component}.cmake DESTINATION ${config_dir})
endforeach()
if(HEBA_BUILD_TOOLS)
  install(TARGETS heba RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()
configure_package_config_file(tools/cmake/hebaConfig.cmake.in ${PROJECT_BINARY_DIR}/hebaConfig.cmake
                              INSTALL_DESTINATION ${config_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/hebaConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/hebaConfig.cmake ${PROJECT_BINARY_DIR}/hebaConfigVersion.cmake
              tools/cmake/FindOpenCV.cmake
        DESTINATION ${config_dir})
