# invar_library and invar_test: every target of ours goes through these two, so that warnings are errors everywhere.

set(INVAR_WARNINGS -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wold-style-cast
    -Wnon-virtual-dtor -Woverloaded-virtual -Wuseless-cast -Wdouble-promotion -Werror)

# -ffp-contract=off keeps simulated time repeatable bit for bit across CPUs.
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")
add_compile_options(-ffp-contract=off)
# GCC collects its garbage only beyond 2 GB: its passes through the heap were a seventh of a first build.
add_compile_options("$<$<COMPILE_LANG_AND_ID:CXX,GNU>:SHELL:--param ggc-min-heapsize=2000000>")
# tools/build compiles the sources of a target in batches (CMAKE_UNITY_BUILD): a first build takes half as long. For GCC all of
# a batch is headers, whose types should have linkage.
if(CMAKE_UNITY_BUILD)
  add_compile_options($<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-subobject-linkage>)
endif()
# What a package names beside what is called stays out of every process.
add_link_options(-Wl,--as-needed)

set(INVAR_SANITIZE "" CACHE STRING "sanitizers to build with, for example address,undefined or thread")
if(INVAR_SANITIZE)
  # A fifth of the time of -O2 with every check. Left out is what another check finds: a null pointer and an object that is too
  # small (address), a wrong type behind a pointer (address, where it is another size), and alignment, which x86-64 does not ask for.
  set(CMAKE_CXX_FLAGS_RELEASE "-O1 -DNDEBUG")
  add_compile_options(-fsanitize=${INVAR_SANITIZE} -fno-sanitize=null,object-size,vptr,alignment -fno-sanitize-recover=all
    -fno-omit-frame-pointer -g1)  # -g1: lines for reports; names of variables cost a third of the build
  add_link_options(-fsanitize=${INVAR_SANITIZE})
  # GCC takes these for found where its checks stand between (std::regex; operator new of a test), and says that the thread
  # sanitizer does not see fences.
  list(APPEND INVAR_WARNINGS -Wno-error=maybe-uninitialized -Wno-error=mismatched-new-delete -Wno-error=tsan)
endif()

# invar_precompile(target headers ...) parses once what most sources of a target include; a third of a first build was that.
# Each source names its includes all the same. ccache needs -fpch-preprocess, and the sloppiness that tools/build sets.
function(invar_precompile target)
  target_precompile_headers(${target} PRIVATE ${ARGN})
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
endfunction()

# invar_share_headers(name library HEADERS ... FOR rooms ...) parses the headers once for all these rooms.
function(invar_share_headers name library)
  cmake_parse_arguments(ARG "" "" "HEADERS;FOR" ${ARGN})
  add_library(invar_${name} OBJECT EXCLUDE_FROM_ALL ${PROJECT_SOURCE_DIR}/cmake/empty.cpp)
  target_compile_options(invar_${name} PRIVATE ${INVAR_WARNINGS})
  target_link_libraries(invar_${name} PRIVATE ${library})
  invar_precompile(invar_${name} ${ARG_HEADERS})
  foreach(room IN LISTS ARG_FOR)
    target_compile_options(invar_${room} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
    target_precompile_headers(invar_${room} REUSE_FROM invar_${name})
  endforeach()
endfunction()

# invar_library(room SOURCES ... HEADERS ... [PUBLIC targets] [PRIVATE targets]) makes invar::room in namespace folder.
function(invar_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;HEADERS;PUBLIC;PRIVATE" ${ARGN})
  add_library(invar_${name} STATIC)
  add_library(invar::${name} ALIAS invar_${name})
  set_target_properties(invar_${name} PROPERTIES EXPORT_NAME ${name})
  target_sources(invar_${name} PRIVATE ${ARG_SOURCES}
    PUBLIC FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${ARG_HEADERS})
  target_compile_options(invar_${name} PRIVATE ${INVAR_WARNINGS})
  target_link_libraries(invar_${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
endfunction()

# invar_loadable(target FILE name SOURCES ... LIBRARIES ...) makes lib/invar/lib<name>.so, which core/base/library.hpp loads. It
# offers only what its sources export; all else stays its own.
function(invar_loadable target)
  cmake_parse_arguments(ARG "" "FILE" "SOURCES;LIBRARIES" ${ARGN})
  add_library(${target} MODULE ${ARG_SOURCES})
  target_compile_options(${target} PRIVATE ${INVAR_WARNINGS})
  target_link_libraries(${target} PRIVATE ${ARG_LIBRARIES})
  target_link_options(${target} PRIVATE -Wl,--exclude-libs,ALL)
  set_target_properties(${target} PROPERTIES OUTPUT_NAME ${ARG_FILE} LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib/invar)
  install(TARGETS ${target} LIBRARY DESTINATION lib/invar COMPONENT vision)
endfunction()

# invar_paths(target) tells a target of the tests where this tree lies. Only the few that read from it: a path on the command
# line keeps ccache from serving another checkout.
function(invar_paths target)
  target_compile_definitions(${target} PRIVATE INVAR_TEST_DATA="${PROJECT_SOURCE_DIR}/tests/data"
    INVAR_SOURCE_DIR="${PROJECT_SOURCE_DIR}" INVAR_PROGRAM="${CMAKE_BINARY_DIR}/bin/invar")
endfunction()

# The headers of every test, parsed once for all.
add_executable(invar_test_headers EXCLUDE_FROM_ALL ${PROJECT_SOURCE_DIR}/cmake/empty.cpp)
target_compile_options(invar_test_headers PRIVATE ${INVAR_WARNINGS})
target_link_libraries(invar_test_headers PRIVATE Eigen3::Eigen GTest::gmock GTest::gtest)
invar_precompile(invar_test_headers <gmock/gmock.h> <gtest/gtest.h> <Eigen/Core> <filesystem> <fstream>)

# invar_test(name SOURCES ... LIBRARIES ... [LABELS ...] [TIMEOUT s] [PATHS]) makes one gtest program; each TEST is one ctest
# entry. PATHS: it knows where this tree lies (invar_paths).
function(invar_test name)
  cmake_parse_arguments(ARG "PATHS" "TIMEOUT" "SOURCES;LIBRARIES;LABELS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 200)  # ten times what a test may take on an idle machine
  endif()
  if(INVAR_SANITIZE)
    math(EXPR ARG_TIMEOUT "10 * ${ARG_TIMEOUT}")
  endif()
  add_executable(test_${name} ${ARG_SOURCES})
  target_compile_options(test_${name} PRIVATE ${INVAR_WARNINGS} $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
  target_precompile_headers(test_${name} REUSE_FROM invar_test_headers)
  if(ARG_PATHS)
    invar_paths(test_${name})
  endif()
  target_link_libraries(test_${name} PRIVATE ${ARG_LIBRARIES} GTest::gmock GTest::gtest GTest::gtest_main)
  gtest_discover_tests(test_${name} DISCOVERY_MODE PRE_TEST PROPERTIES TIMEOUT ${ARG_TIMEOUT} LABELS "${ARG_LABELS}")
endfunction()
