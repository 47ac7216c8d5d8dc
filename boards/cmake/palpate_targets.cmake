# Compile options and helpers that every target of the project uses.

# -ffp-contract=off: no fused multiply-add behind our back, so that x86-64 and Cortex-M give the same bits.
add_library(palpate_options INTERFACE)
target_compile_options(palpate_options INTERFACE
  -ffp-contract=off -fno-math-errno
  $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wpedantic -Werror -Wconversion -Wsign-conversion -Wdouble-promotion
    -Wshadow -Wold-style-cast -Wswitch-enum>)
target_include_directories(palpate_options INTERFACE ${CMAKE_SOURCE_DIR})
# Capacities of a part with less memory than others: its preset sets them (docs/decisions/memory.md).
target_compile_definitions(palpate_options INTERFACE ${PALPATE_CAPACITIES})
if(CMAKE_CROSSCOMPILING)
  # Absolute code, and a call graph with stack sizes beside every object (read by check_image.py).
  set(CMAKE_POSITION_INDEPENDENT_CODE OFF)
  target_compile_options(palpate_options INTERFACE -fcallgraph-info=su)
  include(${CMAKE_CURRENT_LIST_DIR}/bare_metal.cmake)
endif()

# All test programs, and nothing that they do not need.
add_custom_target(palpate_tests)
if(NOT CMAKE_CROSSCOMPILING)
  add_library(palpate_no_threads OBJECT ${CMAKE_CURRENT_LIST_DIR}/no_threads.cpp)
  target_link_libraries(palpate_no_threads PRIVATE palpate_options)
  set_target_properties(palpate_no_threads PROPERTIES EXCLUDE_FROM_ALL TRUE)
endif()

# palpate_test(NAME [THREADS] LIBS lib... SOURCES file...): a GoogleTest program beside its sources, registered with ctest.
# THREADS: its tests start threads, and ThreadSanitizer runs them (PALPATE_TESTS_WITH_THREADS_ONLY); in a program
# without it, a thread is an error (no_threads.cpp).
function(palpate_test name)
  cmake_parse_arguments(arg "THREADS" "" "LIBS;SOURCES" ${ARGN})
  if(CMAKE_CROSSCOMPILING OR NOT PALPATE_TESTS OR (PALPATE_TESTS_WITH_THREADS_ONLY AND NOT arg_THREADS))
    return()
  endif()
  if(NOT arg_THREADS)
    list(APPEND arg_SOURCES $<TARGET_OBJECTS:palpate_no_threads>)
  endif()
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE ${arg_LIBS} palpate_options GTest::gtest GTest::gtest_main Threads::Threads)
  add_dependencies(palpate_tests ${name})
  add_test(NAME ${name} COMMAND ${name})
endfunction()
