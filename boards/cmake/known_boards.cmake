# PALPATE_KNOWN_BOARDS: a folder of boards/ that says what its supervisor may do, in limits.hpp, is a board, and its name
# is what the board calls itself. Firmware, session and device API take the names from here.
file(GLOB _limits CONFIGURE_DEPENDS RELATIVE ${CMAKE_SOURCE_DIR}/boards ${CMAKE_SOURCE_DIR}/boards/*/limits.hpp)
set(PALPATE_KNOWN_BOARDS)
foreach(_file ${_limits})
  get_filename_component(_name ${_file} DIRECTORY)
  list(APPEND PALPATE_KNOWN_BOARDS ${_name})
endforeach()
