# What any board with an STM32F405 builds from this folder. A board's CMakeLists.txt sets the budgets PALPATE_FLASH_BYTES,
# PALPATE_RAM_BYTES and PALPATE_STACK_BYTES, which is part of the RAM, and includes this.
set(_stm32f4 ${CMAKE_CURRENT_LIST_DIR})
set(_script ${CMAKE_CURRENT_BINARY_DIR}/link.ld)
configure_file(${_stm32f4}/link.ld.in ${_script} @ONLY)

# palpate_stm32f4_firmware(IMAGE): the firmware, with the link on USART3.
function(palpate_stm32f4_firmware image)
  palpate_firmware_image(${image} SCRIPT ${_script} LIBS palpate_endpoint_serial
    SOURCES main.cpp board.cpp ${_stm32f4}/clock.cpp ${_stm32f4}/handlers.cpp ${_stm32f4}/usart_link.cpp ${_stm32f4}/vectors.cpp
    CONTEXTS tim7_handler nmi_handler report_fault)
endfunction()
