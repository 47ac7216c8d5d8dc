# Linking and checking of images without an operating system.

# From reset to run_firmware(): an image adds its vectors.
set(PALPATE_START_UP ${PROJECT_SOURCE_DIR}/boards/cortex_m/start_up.cpp)
# What else an image of a part has: its faults, and what it is.
set(PALPATE_CORTEX_M ${PROJECT_SOURCE_DIR}/boards/cortex_m/fault_handlers.cpp ${PROJECT_SOURCE_DIR}/boards/cortex_m/fault_record.cpp
  ${PROJECT_SOURCE_DIR}/boards/cortex_m/image_identity.cpp)

# palpate_bare_metal_link(TARGET SCRIPT): links with the board's script, without start files and standard libraries; the
# toolchain file names the two that are there, newlib's C library for its memory functions, and libgcc. There is
# no _sbrk, no operator new and no C++ run-time: whatever needs a heap or exceptions does not link.
function(palpate_bare_metal_link target script)
  target_link_options(${target} PRIVATE
    -nostdlib -T ${script} -Wl,--gc-sections -Wl,--fatal-warnings -Wl,--orphan-handling=error -Wl,--no-undefined)
  set_property(TARGET ${target} APPEND PROPERTY LINK_DEPENDS ${script} ${PROJECT_SOURCE_DIR}/boards/cortex_m/sections.ld)
endfunction()

# palpate_check_image(TARGET FLASH bytes RAM bytes CONTEXTS function... [INDIRECT function...] OBJECTS target...): after linking, compares the
# image with the part's memory and its deepest stack with the reservation (check_image.py); the build fails above either.
# OBJECTS are all targets whose code the image may contain, INDIRECT the functions in it that are called through pointers.
function(palpate_check_image target)
  cmake_parse_arguments(arg "" "FLASH;RAM" "CONTEXTS;INDIRECT;OBJECTS" ${ARGN})
  set(_script ${PROJECT_SOURCE_DIR}/boards/cmake/check_image.py)
  set(_objects ${arg_OBJECTS})
  list(TRANSFORM _objects REPLACE "(.+)" "$<TARGET_OBJECTS:\\1>")
  add_custom_command(TARGET ${target} POST_BUILD
    COMMAND ${PALPATE_PYTHON} ${_script} --image $<TARGET_FILE:${target}> --compiler ${CMAKE_CXX_COMPILER}
      --flash ${arg_FLASH} --ram ${arg_RAM} --contexts ${arg_CONTEXTS} --indirect ${arg_INDIRECT}
      --table $<TARGET_FILE:${target}>.budget.txt --objects ${_objects}
    COMMAND_EXPAND_LISTS VERBATIM)
  set_property(TARGET ${target} APPEND PROPERTY LINK_DEPENDS ${_script})
endfunction()

# palpate_firmware_image(IMAGE SCRIPT file INCLUDES folder... SOURCES file... CONTEXTS function... LIBS library...): a part's firmware, linked
# with SCRIPT and checked against the board's PALPATE_FLASH_BYTES and PALPATE_RAM_BYTES. SOURCES are the board's and its family's; what any
# Cortex-M has is added. INCLUDES are folders of the board beside its own. CONTEXTS are the entry functions of interrupts, the lowest
# priority first, those of one priority joined by "|". LIBS are the image's own, one of palpate_endpoint_* among them.
function(palpate_firmware_image image)
  cmake_parse_arguments(arg "" "SCRIPT" "INCLUDES;SOURCES;CONTEXTS;LIBS" ${ARGN})
  set(_objects ${image}_objects)
  list(TRANSFORM arg_INCLUDES PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
  add_library(${_objects} OBJECT ${PALPATE_START_UP} ${PALPATE_CORTEX_M} ${arg_SOURCES})
  target_include_directories(${_objects} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR} ${arg_INCLUDES})
  target_compile_definitions(${_objects} PRIVATE PALPATE_VERSION="${PROJECT_VERSION}")
  target_link_libraries(${_objects} PUBLIC ${arg_LIBS})
  add_executable(${image})
  set_target_properties(${image} PROPERTIES SUFFIX .elf LINKER_LANGUAGE CXX)
  target_link_libraries(${image} PRIVATE ${_objects})
  palpate_bare_metal_link(${image} ${arg_SCRIPT})
  set(_indirect "")
  if(palpate_tinyusb IN_LIST arg_LIBS)
    set(_indirect ${PALPATE_TINYUSB_INDIRECT})
  endif()
  palpate_check_image(${image}
    FLASH ${PALPATE_FLASH_BYTES} RAM ${PALPATE_RAM_BYTES}
    CONTEXTS start_up ${arg_CONTEXTS}
    INDIRECT ${_indirect} OBJECTS ${_objects} ${arg_LIBS} palpate_firmware palpate_shared)
endfunction()
