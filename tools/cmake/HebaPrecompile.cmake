# Precompiled headers: half of a source's compile time is the parsing of Eigen and the standard library, and a third of the
# rest the instantiation of what heba's own types consist of. A build with HEBA_PRECOMPILE=OFF, as the presets tidy and
# fuzz make it, shows whether every source includes what it uses.
option(HEBA_PRECOMPILE "Precompile the headers of Eigen, OpenCV, the standard library and heba's own types" ON)
set(HEBA_COMMON_HEADERS
  <algorithm> <array> <cmath> <filesystem> <functional> <map> <memory> <numeric> <optional> <sstream> <string> <string_view> <utility> <vector>
  <Eigen/Cholesky> <Eigen/Core> <Eigen/Eigenvalues> <Eigen/Geometry> <Eigen/LU> <Eigen/QR> <Eigen/SVD>)
# The types of which most sources use some, from the bottom up: each header includes those of the lists before it.
set(HEBA_PROBLEM_TYPES <heba/base/error.h> <heba/data/solution.h>)
set(HEBA_CALIBRATION_TYPES ${HEBA_PROBLEM_TYPES} <heba/pair_calibration.h>)
set(HEBA_RUN_TYPES ${HEBA_CALIBRATION_TYPES} <heba/run_types.h>)

# heba_precompile(target header...): the common headers and those named.
function(heba_precompile target)
  if(HEBA_PRECOMPILE)
    target_precompile_headers(${target} PRIVATE ${HEBA_COMMON_HEADERS} ${ARGN})
  endif()
endfunction()

# heba_reuse_precompiled(target from): what `from` has precompiled, for a target with the same compile options.
function(heba_reuse_precompiled target from)
  if(HEBA_PRECOMPILE)
    target_precompile_headers(${target} REUSE_FROM ${from})
  endif()
endfunction()
