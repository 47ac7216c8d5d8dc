# What a folder of boards/ is, by what lies in it. PALPATE_KNOWN_BOARDS: it says what its supervisor may do, in limits.hpp; its name is
# what the board calls itself, and session and device API, which take the names from here, arm no other. PALPATE_SKELETON_BOARDS: it says
# what it has no driver for, in skeleton.txt; it builds, and hosts do not arm it.
function(palpate_boards_with file result)
  file(GLOB _found CONFIGURE_DEPENDS RELATIVE ${CMAKE_SOURCE_DIR}/boards ${CMAKE_SOURCE_DIR}/boards/*/${file})
  list(TRANSFORM _found REPLACE "/.*" "")
  set(${result} ${_found} PARENT_SCOPE)
endfunction()
palpate_boards_with(limits.hpp PALPATE_KNOWN_BOARDS)
palpate_boards_with(skeleton.txt PALPATE_SKELETON_BOARDS)
foreach(_name ${PALPATE_SKELETON_BOARDS})
  if(_name IN_LIST PALPATE_KNOWN_BOARDS)
    message(FATAL_ERROR "boards/${_name} has limits.hpp and skeleton.txt: a board that hosts arm has a driver for everything")
  endif()
endforeach()
