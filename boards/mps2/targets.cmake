# What both MPS2 boards build from this folder. A board's CMakeLists.txt sets PALPATE_FLASH_BYTES, PALPATE_RAM_BYTES and
# PALPATE_STACK_BYTES, which is part of the RAM, to those of the part that it stands for, includes this, and has part.hpp.
set(_mps2 ${CMAKE_CURRENT_LIST_DIR})
set(_script ${CMAKE_CURRENT_BINARY_DIR}/link.ld)
configure_file(${_mps2}/link.ld.in ${_script} @ONLY)

# palpate_mps2_firmware(IMAGE OBJECTS WIRE LIB...): the firmware, with what carries the link in lock-step
# (boards/lockstep/over_*). LIB are the libraries that are its own, those that the budgets look into.
function(palpate_mps2_firmware image objects wire)
  add_library(${objects} OBJECT ${_mps2}/main.cpp ${_mps2}/platform.cpp ${_mps2}/startup.cpp
    ${PALPATE_START_UP})
  target_include_directories(${objects} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/boards/lockstep/${wire})
  target_compile_definitions(${objects} PRIVATE PALPATE_VERSION="${PROJECT_VERSION}")
  target_link_libraries(${objects} PUBLIC ${ARGN})
  add_executable(${image})
  set_target_properties(${image} PROPERTIES SUFFIX .elf LINKER_LANGUAGE CXX)
  target_link_libraries(${image} PRIVATE ${objects})
  palpate_bare_metal_link(${image} ${_script})
  set(_indirect "")
  if(palpate_tinyusb IN_LIST ARGN)
    set(_indirect ${PALPATE_TINYUSB_INDIRECT})
  endif()
  palpate_check_image(${image}
    FLASH ${PALPATE_FLASH_BYTES} RAM ${PALPATE_RAM_BYTES}
    # Entry functions by priority: each may interrupt those before it.
    CONTEXTS start_up uart1_receive_handler timer0_handler report_hard_fault
    INDIRECT ${_indirect} OBJECTS ${objects} ${ARGN} palpate_firmware palpate_shared)
endfunction()
foreach(_framing ${PALPATE_FRAMINGS})
  palpate_image_name(${PALPATE_BOARD} ${_framing} _image)
  palpate_mps2_firmware(${_image} palpate_mps2_${_framing} over_bytes palpate_endpoint_${_framing})
endforeach()

# With the link on USB.
if(TARGET palpate_virtual_usb)
  palpate_mps2_firmware(palpate_${PALPATE_BOARD}_usb palpate_mps2_usb over_usb
    palpate_endpoint_serial palpate_virtual_usb palpate_usb palpate_tinyusb)
else()
  add_custom_target(palpate_${PALPATE_BOARD}_usb)  # for who asks for all images: there is none
endif()

# palpate_mps2_program(NAME SOURCE LIBRARY): an image of its own, NAME_BOARD.elf, that runs without interrupts.
function(palpate_mps2_program name source library)
  set(_target ${name}_${PALPATE_BOARD})
  add_executable(${_target} ${_mps2}/${source} ${_mps2}/no_interrupts.cpp ${_mps2}/startup.cpp
    ${PALPATE_START_UP})
  set_target_properties(${_target} PROPERTIES SUFFIX .elf)
  target_link_libraries(${_target} PRIVATE ${library})
  palpate_bare_metal_link(${_target} ${_script})
endfunction()

# The golden trace on this processor (hil_tests/test_golden.py).
palpate_mps2_program(golden golden_main.cpp palpate_golden)
