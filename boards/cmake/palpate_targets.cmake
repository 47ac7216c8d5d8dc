# Compile options and helpers that every target of the project uses.

# -ffp-contract=off: no fused multiply-add behind our back, so that x86-64 and Cortex-M give the same bits.
add_library(palpate_options INTERFACE)
target_compile_options(palpate_options INTERFACE
  -ffp-contract=off -fno-math-errno
  $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wpedantic -Werror -Wconversion -Wsign-conversion -Wdouble-promotion
    -Wshadow -Wold-style-cast -Wswitch-enum>)
target_include_directories(palpate_options INTERFACE ${CMAKE_SOURCE_DIR})
if(CMAKE_CROSSCOMPILING)
  # Absolute code, and a call graph with stack sizes beside every object (read by check_image.py).
  set(CMAKE_POSITION_INDEPENDENT_CODE OFF)
  target_compile_options(palpate_options INTERFACE -fcallgraph-info=su)
  include(${CMAKE_CURRENT_LIST_DIR}/bare_metal.cmake)
endif()

# palpate_test(NAME LIBS lib... SOURCES file...): a GoogleTest program beside its sources, registered with ctest.
function(palpate_test name)
  cmake_parse_arguments(arg "" "" "LIBS;SOURCES" ${ARGN})
  if(CMAKE_CROSSCOMPILING OR NOT PALPATE_TESTS)
    return()
  endif()
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE ${arg_LIBS} palpate_options GTest::gtest GTest::gtest_main Threads::Threads)
  add_test(NAME ${name} COMMAND ${name})
endfunction()
