# heba_add_library(core ROOT dir HEADERS ... SOURCES ... DEPENDS ... PRIVATE_DEPENDS ...)
# A library heba_core with the alias heba::core, its headers found from ROOT, each checked to compile alone
# (target all_verify_interface_header_sets).
function(heba_add_library name)
  cmake_parse_arguments(ARG "" "ROOT" "HEADERS;SOURCES;DEPENDS;PRIVATE_DEPENDS" ${ARGN})
  set(target heba_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(heba::${name} ALIAS ${target})
  target_sources(${target} PUBLIC FILE_SET HEADERS BASE_DIRS ${ARG_ROOT} FILES ${ARG_HEADERS})
  target_link_libraries(${target} PUBLIC ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE_DEPENDS} $<BUILD_INTERFACE:heba_options>)
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON
                                             VERIFY_INTERFACE_HEADER_SETS ON)
  set_property(GLOBAL APPEND PROPERTY HEBA_LIBRARIES ${target})
endfunction()
