# Every page with commands is run as a reader would type them; tests/tutorials.py says how a block is marked.
set(pages
  docs/tutorials/first-cell.md docs/tutorials/first-component.md docs/tutorials/calibrate-a-table.md
  docs/tutorials/find-missing-physics.md docs/tutorials/print-and-correct.md)
set(tutorials ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/tutorials.py)
add_test(NAME Pages.FaultsAreFound COMMAND ${tutorials} self-test)
add_test(NAME Pages.EachIsRunOrSaysWhyNot COMMAND ${tutorials} complete ${PROJECT_SOURCE_DIR} ${pages})
add_test(NAME Pages.BlocksThatAreNotRun COMMAND ${tutorials} list ${PROJECT_SOURCE_DIR})
add_test(NAME Pages.Install COMMAND ${tutorials} install ${CMAKE_BINARY_DIR} ${PROJECT_SOURCE_DIR})
set_tests_properties(Pages.Install PROPERTIES FIXTURES_SETUP installed_pages TIMEOUT 60)
foreach(page IN LISTS pages)
  add_test(NAME Pages.Run/${page} COMMAND ${tutorials} run ${CMAKE_BINARY_DIR} ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/${page})
  set_tests_properties(Pages.Run/${page} PROPERTIES FIXTURES_REQUIRED installed_pages TIMEOUT 150)
endforeach()
