# cmake --install gives a find_package(heba) package: heba::core, heba::solvers, heba::targets, and the program.
include(CMakePackageConfigHelpers)
get_property(libraries GLOBAL PROPERTY HEBA_LIBRARIES)
install(TARGETS ${libraries} EXPORT heba_targets_export
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
        FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/heba)
if(HEBA_BUILD_TOOLS)
  install(TARGETS heba RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()
set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/heba)
install(EXPORT heba_targets_export NAMESPACE heba:: FILE hebaTargets.cmake DESTINATION ${config_dir})
configure_package_config_file(tools/cmake/hebaConfig.cmake.in ${PROJECT_BINARY_DIR}/hebaConfig.cmake
                              INSTALL_DESTINATION ${config_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/hebaConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/hebaConfig.cmake ${PROJECT_BINARY_DIR}/hebaConfigVersion.cmake
        DESTINATION ${config_dir})
