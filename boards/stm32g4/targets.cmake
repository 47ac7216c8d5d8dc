# What any board with an STM32G4 builds from this folder. A board's CMakeLists.txt sets the budgets PALPATE_FLASH_BYTES,
# PALPATE_RAM_BYTES and PALPATE_STACK_BYTES, which is part of the RAM, and includes this.
set(_stm32g4 ${CMAKE_CURRENT_LIST_DIR})
set(_script ${CMAKE_CURRENT_BINARY_DIR}/link.ld)
configure_file(${_stm32g4}/link.ld.in ${_script} @ONLY)

# palpate_stm32g4_firmware(IMAGE WIRE CONTEXTS function... SOURCES file... LIBS library...): the firmware, with what carries the
# link in the board's folder WIRE. CONTEXTS are entry functions of the link's interrupts, those of one priority joined by "|";
# SOURCES the link's driver; LIBS the libraries that are the image's own, those that the budgets look into.
function(palpate_stm32g4_firmware image wire)
  cmake_parse_arguments(arg "" "" "CONTEXTS;SOURCES;LIBS" ${ARGN})
  list(TRANSFORM arg_SOURCES PREPEND ${_stm32g4}/)
  palpate_firmware_image(${image} SCRIPT ${_script} INCLUDES ${wire} LIBS ${arg_LIBS}
    SOURCES main.cpp board.cpp ${arg_SOURCES} ${_stm32g4}/clock.cpp ${_stm32g4}/currents.cpp ${_stm32g4}/encoders.cpp
      ${_stm32g4}/handlers.cpp ${_stm32g4}/parameter_flash.cpp ${_stm32g4}/vectors.cpp
    CONTEXTS ${arg_CONTEXTS} tim7_handler nmi_handler report_fault)
endfunction()
