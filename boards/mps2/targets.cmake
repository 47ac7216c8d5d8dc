# What both MPS2 boards build from this folder. A board's CMakeLists.txt sets PALPATE_FLASH_BYTES, PALPATE_RAM_BYTES and
# PALPATE_STACK_BYTES, which is part of the RAM, to those of the part that it stands for, includes this, and has part.hpp.
set(_mps2 ${CMAKE_CURRENT_LIST_DIR})
set(_script ${CMAKE_CURRENT_BINARY_DIR}/link.ld)
configure_file(${_mps2}/link.ld.in ${_script} @ONLY)

foreach(_framing ${PALPATE_FRAMINGS})
  set(_objects palpate_mps2_${_framing})
  add_library(${_objects} OBJECT ${_mps2}/main.cpp ${_mps2}/platform.cpp ${_mps2}/startup.cpp)
  target_include_directories(${_objects} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
  target_compile_definitions(${_objects} PRIVATE PALPATE_VERSION="${PROJECT_VERSION}")
  target_link_libraries(${_objects} PUBLIC palpate_endpoint_${_framing})

  palpate_image_name(${PALPATE_BOARD} ${_framing} _image)
  add_executable(${_image})
  set_target_properties(${_image} PROPERTIES SUFFIX .elf LINKER_LANGUAGE CXX)
  target_link_libraries(${_image} PRIVATE ${_objects})
  palpate_bare_metal_link(${_image} ${_script})
  palpate_check_image(${_image}
    FLASH ${PALPATE_FLASH_BYTES} RAM ${PALPATE_RAM_BYTES}
    # Entry functions by priority: each may interrupt those before it.
    CONTEXTS start_up uart1_receive_handler timer0_handler report_hard_fault
    OBJECTS ${_objects} palpate_endpoint_${_framing} palpate_firmware palpate_shared)
endforeach()

# palpate_mps2_program(NAME SOURCE LIBRARY): an image of its own, NAME_BOARD.elf, that runs without interrupts.
function(palpate_mps2_program name source library)
  set(_target ${name}_${PALPATE_BOARD})
  add_executable(${_target} ${_mps2}/${source} ${_mps2}/no_interrupts.cpp ${_mps2}/startup.cpp)
  set_target_properties(${_target} PROPERTIES SUFFIX .elf)
  target_link_libraries(${_target} PRIVATE ${library})
  palpate_bare_metal_link(${_target} ${_script})
endfunction()

# The golden trace on this processor (hil_tests/test_golden.py).
palpate_mps2_program(golden golden_main.cpp palpate_golden)
