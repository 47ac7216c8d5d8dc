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
  set(_objects ${image}_objects)
  list(TRANSFORM arg_SOURCES PREPEND ${_stm32g4}/)
  add_library(${_objects} OBJECT main.cpp board.cpp calibration.cpp ${PALPATE_START_UP} ${arg_SOURCES}
    ${_stm32g4}/clock.cpp ${_stm32g4}/currents.cpp ${_stm32g4}/encoders.cpp ${_stm32g4}/fault_record.cpp
    ${_stm32g4}/handlers.cpp ${_stm32g4}/parameter_flash.cpp ${_stm32g4}/vectors.cpp)
  target_include_directories(${_objects} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR}/${wire})
  target_compile_definitions(${_objects} PRIVATE PALPATE_VERSION="${PROJECT_VERSION}")
  target_link_libraries(${_objects} PUBLIC ${arg_LIBS})
  add_executable(${image})
  set_target_properties(${image} PROPERTIES SUFFIX .elf LINKER_LANGUAGE CXX)
  target_link_libraries(${image} PRIVATE ${_objects})
  palpate_bare_metal_link(${image} ${_script})
  set(_indirect "")
  if(palpate_tinyusb IN_LIST arg_LIBS)
    set(_indirect ${PALPATE_TINYUSB_INDIRECT})
  endif()
  palpate_check_image(${image}
    FLASH ${PALPATE_FLASH_BYTES} RAM ${PALPATE_RAM_BYTES}
    # Entry functions by priority: each may interrupt those before it.
    CONTEXTS start_up ${arg_CONTEXTS} tim7_handler nmi_handler report_fault
    INDIRECT ${_indirect} OBJECTS ${_objects} ${arg_LIBS} palpate_firmware palpate_shared)
endfunction()
