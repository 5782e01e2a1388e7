# Build settings shared by every folder, and the three functions that declare what a folder holds.
include_guard(GLOBAL)
include(GNUInstallDirs)
include(GoogleTest)

option(IMUSCOPE_TESTS "Build the tests" ON)
option(IMUSCOPE_WERROR "Treat warnings as errors" ON)
option(IMUSCOPE_FUZZ "Build the libFuzzer targets (clang only)" OFF)
option(IMUSCOPE_TRIALS "Build the trials and benchmarks that no test runs, too" OFF)
set(IMUSCOPE_SANITIZE "" CACHE STRING "Sanitizers to build with: empty, 'address,undefined' or 'thread'")

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()

find_program(IMUSCOPE_CCACHE ccache)
if(IMUSCOPE_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${IMUSCOPE_CCACHE})
endif()

find_package(Threads REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(fmt REQUIRED)
find_package(spdlog REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(CLI11 REQUIRED)
find_package(Boost 1.74 REQUIRED)
find_path(IMUSCOPE_TOMLPLUSPLUS_DIR toml++/toml.h REQUIRED)
find_path(IMUSCOPE_EXPECTED_DIR tl/expected.hpp REQUIRED)

# toml++ as the service and the simulator, which share nothing else, both have to take it.
add_library(careful_toml INTERFACE)
target_include_directories(careful_toml INTERFACE ${CMAKE_SOURCE_DIR}/cmake/toml)
target_include_directories(careful_toml SYSTEM INTERFACE ${IMUSCOPE_TOMLPLUSPLUS_DIR})

add_library(imuscope_flags INTERFACE)
target_compile_options(imuscope_flags INTERFACE
  -Wall -Wextra -Wconversion -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual
  # The estimate is a function of its inputs: the compiler may not fuse multiply and add where it likes.
  -ffp-contract=off)
if(IMUSCOPE_WERROR)
  target_compile_options(imuscope_flags INTERFACE -Werror)
endif()
if(IMUSCOPE_SANITIZE)
  target_compile_options(imuscope_flags INTERFACE
    -fsanitize=${IMUSCOPE_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    target_compile_options(imuscope_flags INTERFACE
      -fsanitize-ignorelist=${CMAKE_CURRENT_LIST_DIR}/sanitizer_ignorelist.txt)
  endif()
  target_compile_definitions(imuscope_flags INTERFACE _GLIBCXX_ASSERTIONS)
  target_link_options(imuscope_flags INTERFACE -fsanitize=${IMUSCOPE_SANITIZE})
endif()
if(IMUSCOPE_FUZZ)
  target_compile_options(imuscope_flags INTERFACE -fsanitize=fuzzer-no-link)
endif()
target_link_libraries(imuscope_flags INTERFACE Threads::Threads)

# Every folder is seen through a directory of its own that holds one link to it, so that a target finds
# only the headers of the folders it links: an include against the flow does not compile.
function(imuscope_layer target folder)
  set(layer ${CMAKE_BINARY_DIR}/layers/${target})
  string(REGEX REPLACE "^src/" "" name ${folder})
  get_filename_component(parent ${layer}/${name} DIRECTORY)
  file(MAKE_DIRECTORY ${parent})
  file(CREATE_LINK ${CMAKE_SOURCE_DIR}/${folder} ${layer}/${name} SYMBOLIC)
  set_property(GLOBAL PROPERTY IMUSCOPE_LAYER_${target} ${layer})
endfunction()

# imuscope_library(NAME SOURCES a.cpp ... PUBLIC libs... PRIVATE libs...)
# Declares the library of the current folder. Without SOURCES it is header-only.
function(imuscope_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  file(RELATIVE_PATH folder ${CMAKE_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  imuscope_layer(${name} ${folder})
  if(ARG_SOURCES)
    add_library(${name} STATIC ${ARG_SOURCES})
    # Also part of shared objects: the Python module, the HDF5 export. Hidden, its code is that of a program all the same.
    set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ON CXX_VISIBILITY_PRESET hidden)
    target_include_directories(${name} PUBLIC ${CMAKE_BINARY_DIR}/layers/${name})
    target_link_libraries(${name} PUBLIC ${ARG_PUBLIC} PRIVATE imuscope_flags ${ARG_PRIVATE})
  else()
    add_library(${name} INTERFACE)
    target_include_directories(${name} INTERFACE ${CMAKE_BINARY_DIR}/layers/${name})
    target_link_libraries(${name} INTERFACE ${ARG_PUBLIC})
  endif()
endfunction()

# imuscope_embed(VARIABLE ROOM function=file ...)
# The files, of the current folder or with a whole path, as functions of C++ that return them, as the room's assets.h
# declares them. VARIABLE gets the path of the source that is written.
function(imuscope_embed variable room)
  set(assets)
  set(files)
  foreach(asset ${ARGN})
    string(REGEX MATCH "^([^=]*)=(.*)$" matched ${asset})
    get_filename_component(file ${CMAKE_MATCH_2} ABSOLUTE)
    list(APPEND assets "${CMAKE_MATCH_1}=${file}")
    list(APPEND files ${file})
  endforeach()
  set(output ${CMAKE_CURRENT_BINARY_DIR}/${room}_assets.cpp)
  file(RELATIVE_PATH header ${CMAKE_SOURCE_DIR}/src ${CMAKE_CURRENT_SOURCE_DIR}/assets.h)
  set(script ${CMAKE_SOURCE_DIR}/cmake/embed_assets.cmake)
  string(REPLACE ";" "|" assets "${assets}")
  add_custom_command(
    OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -D "ASSETS=${assets}" -D ROOM=${room} -D HEADER=${header} -D OUTPUT=${output} -P ${script}
    DEPENDS ${files} ${script}
    COMMENT "Embedding files of src/${room}"
    VERBATIM)
  # For those who compile units one by one.
  add_custom_target(embedded_in_${room} DEPENDS ${output})
  if(NOT TARGET embedded_sources)
    add_custom_target(embedded_sources)
  endif()
  add_dependencies(embedded_sources embedded_in_${room})
  set(${variable} ${output} PARENT_SCOPE)
endfunction()

# imuscope_program(NAME SOURCES a.cpp ... LIBS libs...)
function(imuscope_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE imuscope_flags ${ARG_LIBS})
endfunction()

# imuscope_test(NAME SOURCES a_test.cpp ... LIBS libs... [TIMEOUT seconds] [SLOW] [ALONE])
# One GoogleTest program; every test case is a CTest test of its own. SLOW: left out by tools/test --quick.
# ALONE: runs in real time, so that no other of these may run beside it, and others only at the lowest priority; left
# out by --quick, too.
function(imuscope_test name)
  cmake_parse_arguments(ARG "SLOW;ALONE" "TIMEOUT" "SOURCES;LIBS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  # Others have the processor first; what hangs is still found.
  if(NOT ARG_ALONE)
    math(EXPR ARG_TIMEOUT "3 * ${ARG_TIMEOUT}")
  endif()
  # Counters and sanitizers slow a program down.
  if(NOT CMAKE_BUILD_TYPE STREQUAL "Release")
    math(EXPR ARG_TIMEOUT "5 * ${ARG_TIMEOUT}")
  endif()
  if(CMAKE_CROSSCOMPILING)
    math(EXPR ARG_TIMEOUT "20 * ${ARG_TIMEOUT}")  # emulated
  endif()
  set(labels)
  if(ARG_ALONE)
    set(labels LABELS alone RUN_SERIAL TRUE)
  elseif(ARG_SLOW)
    set(labels LABELS slow)
  endif()
  if(IMUSCOPE_SANITIZE STREQUAL "thread")
    list(APPEND labels ENVIRONMENT TSAN_OPTIONS=suppressions=${CMAKE_SOURCE_DIR}/tests/tsan.supp)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  # Much of a test program's build is the optimisation of what runs once: a fifth, with a sanitizer most. What it tests
  # is optimised as in every build.
  if(IMUSCOPE_SANITIZE)
    target_compile_options(${name} PRIVATE -O0)
  else()
    target_compile_options(${name} PRIVATE -O1)
  endif()
  target_link_libraries(${name} PRIVATE imuscope_flags ${ARG_LIBS} test_support
                        GTest::gmock GTest::gtest_main)
  gtest_discover_tests(${name} TEST_PREFIX ${name}. DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60
                       PROPERTIES TIMEOUT ${ARG_TIMEOUT} ${labels})
endfunction()

# imuscope_test_not_here(NAME REASON)
# Stands where a test cannot be in this build: CTest counts it as skipped and tells the reason.
function(imuscope_test_not_here name reason)
  add_test(NAME ${name} COMMAND ${CMAKE_COMMAND} -E echo "${name}: Skipped\n${reason}")
  set_tests_properties(${name} PROPERTIES SKIP_REGULAR_EXPRESSION ": Skipped")
endfunction()
