# heba_add_library(core ROOT dir PUBLIC header... HEADERS header... SOURCES ... DEPENDS ... PRIVATE_DEPENDS ...)
# A library heba_core with the alias heba::core. The headers in PUBLIC are installed; they are found from ROOT (default:
# include/ beside the CMakeLists.txt) and named heba/... . HEADERS are private: the other parts of heba include them, the
# package does not have them. Each header is checked to compile alone (target all_verify_interface_header_sets).
function(heba_add_library name)
  cmake_parse_arguments(ARG "" "ROOT" "PUBLIC;HEADERS;SOURCES;DEPENDS;PRIVATE_DEPENDS" ${ARGN})
  if(NOT ARG_ROOT)
    set(ARG_ROOT ${CMAKE_CURRENT_SOURCE_DIR}/include)
  endif()
  set(target heba_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(heba::${name} ALIAS ${target})
  list(TRANSFORM ARG_PUBLIC PREPEND ${ARG_ROOT}/)
  target_sources(${target} PUBLIC FILE_SET HEADERS BASE_DIRS ${ARG_ROOT} FILES ${ARG_PUBLIC})
  # Private headers are named from the project's root, or from ROOT.
  target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
  target_link_libraries(${target} PUBLIC ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE_DEPENDS} $<BUILD_INTERFACE:heba_options>)
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON
                                             VERIFY_INTERFACE_HEADER_SETS ON)
  # The properties of sources may be set after this.
  cmake_language(EVAL CODE "cmake_language(DEFER CALL heba_unite ${target})")
  # For the package: the libraries, each after those that it builds on.
  set_property(GLOBAL APPEND PROPERTY HEBA_LIBRARIES ${name})
  list(FILTER ARG_DEPENDS INCLUDE REGEX "^heba::")
  list(TRANSFORM ARG_DEPENDS REPLACE "^heba::" "")
  set_property(GLOBAL PROPERTY HEBA_${name}_BUILDS_ON ${ARG_DEPENDS})
  # The private headers are checked as the public ones of a target that nothing links.
  add_library(${target}_private_headers INTERFACE)
  target_sources(${target}_private_headers INTERFACE FILE_SET HEADERS BASE_DIRS ${CMAKE_CURRENT_SOURCE_DIR}
                                                     FILES ${ARG_HEADERS})
  target_link_libraries(${target}_private_headers INTERFACE ${target} ${ARG_PRIVATE_DEPENDS})
  set_target_properties(${target}_private_headers PROPERTIES VERIFY_INTERFACE_HEADER_SETS ON)
endfunction()
