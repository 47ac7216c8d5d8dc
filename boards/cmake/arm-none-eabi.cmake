# Cross compiler for Cortex-M boards. The preset names the processor: PALPATE_CPU and PALPATE_FPU, as the compiler calls
# them. The board's own folder adds its linker script and start-up code.
foreach(_name PALPATE_CPU PALPATE_FPU)
  if(NOT DEFINED ${_name})
    message(FATAL_ERROR "${_name} is not set: use a preset of CMakePresets.json")
  endif()
endforeach()
# The toolchain file is read again, without the cache, for what CMake compiles to try the compiler.
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES PALPATE_CPU PALPATE_FPU)
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_ASM_COMPILER arm-none-eabi-gcc)
set(CMAKE_OBJCOPY arm-none-eabi-objcopy)
set(CMAKE_SIZE arm-none-eabi-size)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(_cpu "-mcpu=${PALPATE_CPU} -mthumb -mfloat-abi=hard -mfpu=${PALPATE_FPU}")
set(CMAKE_C_FLAGS_INIT "${_cpu} -ffreestanding -ffunction-sections -fdata-sections")
set(CMAKE_CXX_FLAGS_INIT
    "${_cpu} -ffunction-sections -fdata-sections -fno-exceptions -fno-rtti -fno-threadsafe-statics -fno-use-cxa-atexit")
set(CMAKE_C_FLAGS_RELEASE_INIT "-O3 -g")
set(CMAKE_CXX_FLAGS_RELEASE_INIT "-O3 -g")
# Last on the link line.
set(CMAKE_CXX_STANDARD_LIBRARIES_INIT "-Wl,--start-group -lc -lgcc -Wl,--end-group")
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
