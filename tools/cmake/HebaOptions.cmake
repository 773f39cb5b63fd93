# What every heba target is compiled with. An INTERFACE target: nothing global, nothing that a consumer inherits.
add_library(heba_options INTERFACE)
target_compile_options(heba_options INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Wold-style-cast
                                              -Woverloaded-virtual -Wunused -Wnull-dereference -Wformat=2
                                              -Wno-psabi)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # g++ 12 sees null dereferences and overlaps inside Eigen's and the standard library's inlined code that are not there
  # (GCC bug 105651).
  target_compile_options(heba_options INTERFACE -Wno-null-dereference -Wno-restrict)
  if(HEBA_PRECOMPILE)
    # With -fpch-preprocess ccache knows precompiled headers. g++ 12 forgets there that the standard library's headers are
    # the system's, and reports overflows in their inlined code (GCC bug 105329); builds without, and clang, still warn.
    target_compile_options(heba_options INTERFACE -fpch-preprocess -Wno-array-bounds -Wno-stringop-overflow
                                                  -Wno-stringop-overread)
    # The compiler's garbage collection starts at 128 MB, which the precompiled headers have from the start: it then costs
    # a tenth of the time of every source, and saves 30 MB of 500.
    target_compile_options(heba_options INTERFACE "SHELL:--param ggc-min-heapsize=400000")
  endif()
endif()
if(HEBA_WARNINGS_AS_ERRORS)
  target_compile_options(heba_options INTERFACE -Werror)
endif()
# Against hostile files: what overflows a stack or a buffer of known size ends the program, and the tables of foreign
# functions cannot be written once it runs. The sanitizers have checks of their own.
if(HEBA_HARDEN AND NOT HEBA_SANITIZE)
  target_compile_options(heba_options INTERFACE -fstack-protector-strong)
  if(NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
    target_compile_options(heba_options INTERFACE -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=2)
  endif()
  target_link_options(heba_options INTERFACE LINKER:-z,relro LINKER:-z,now)
endif()
if(HEBA_SANITIZE)
  target_compile_options(heba_options INTERFACE -fsanitize=${HEBA_SANITIZE} -fno-omit-frame-pointer
                                                -fno-sanitize-recover=all)
  target_link_options(heba_options INTERFACE -fsanitize=${HEBA_SANITIZE})
  # Eigen's own aligned allocator and the distribution's Ceres disagree about a block's header: not an overflow.
  target_compile_definitions(heba_options INTERFACE EIGEN_MALLOC_ALREADY_ALIGNED=1)
endif()
if(HEBA_FUZZ)
  target_compile_options(heba_options INTERFACE -fsanitize=fuzzer-no-link)
endif()
if(CMAKE_BUILD_TYPE STREQUAL "Debug")
  target_compile_definitions(heba_options INTERFACE EIGEN_INITIALIZE_MATRICES_BY_NAN)
endif()
