# Linking and checking of images without an operating system.

# From reset to run_firmware(): an image adds its vectors.
set(PALPATE_START_UP ${PROJECT_SOURCE_DIR}/boards/cortex_m/start_up.cpp)

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
