# Every page with commands is run as a reader would type them; tests/tutorials.py says how a block is marked.
set(pages
  docs/tutorials/first-cell.md
  docs/tutorials/first-component.md
  docs/tutorials/calibrate-a-table.md
  docs/tutorials/find-missing-physics.md
  docs/tutorials/print-and-correct.md
  docs/how-to/apply-a-model.md
  docs/how-to/calibrate.md
  docs/how-to/connect-to-the-plant.md
  docs/how-to/correct-live.md
  docs/how-to/deploy-a-cell.md
  docs/how-to/diagnose-a-recording.md
  docs/how-to/export-to-a-controller.md
  docs/how-to/fuse-sensors.md
  docs/how-to/modbus-devices.md
  docs/how-to/other-dds-programs.md
  docs/how-to/own-equations.md
  docs/how-to/read-a-diagnosis-report.md
  docs/how-to/real-time-host.md
  docs/how-to/secure-a-cell.md
  docs/how-to/standby.md
  docs/how-to/troubleshooting.md
  docs/how-to/use-a-camera.md
  docs/how-to/watch-a-cell.md
  docs/how-to/write-a-component.md
  examples/cyclone/README.md
  examples/diagnose/README.md
  examples/low_pass/README.md
  examples/modbus_sensor/README.md
  examples/one_axis/README.md
  examples/own_term/README.md
  examples/pad_heater/README.md)
set(tutorials ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/tutorials.py)
add_test(NAME Pages.FaultsAreFound COMMAND ${tutorials} self-test)
add_test(NAME Pages.EachIsRunOrSaysWhyNot COMMAND ${tutorials} complete ${PROJECT_SOURCE_DIR} ${pages})
add_test(NAME Pages.BlocksThatAreNotRun COMMAND ${tutorials} list ${PROJECT_SOURCE_DIR})
add_test(NAME Pages.Install COMMAND ${tutorials} install ${CMAKE_BINARY_DIR} ${PROJECT_SOURCE_DIR})
set_tests_properties(Pages.Install PROPERTIES FIXTURES_SETUP installed_pages TIMEOUT 60)
foreach(page IN LISTS pages)
  add_test(NAME Pages.Run/${page} COMMAND ${tutorials} run ${CMAKE_BINARY_DIR} ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/${page})
  set_tests_properties(Pages.Run/${page} PROPERTIES FIXTURES_REQUIRED installed_pages TIMEOUT 150 PROCESSORS 2)  # most run a cell of five processes
endforeach()
add_test(NAME New.WritesWhatBuildsAndRunsAndOverwritesNothing
  COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/cell/new_test.py ${CMAKE_BINARY_DIR}/pages ${PROJECT_SOURCE_DIR})
set_tests_properties(New.WritesWhatBuildsAndRunsAndOverwritesNothing PROPERTIES FIXTURES_REQUIRED installed_pages TIMEOUT 200 PROCESSORS 2)
add_test(NAME Pages.TheMessagesOfTroubleshootingAreTheProgramsOwn
  COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/check_troubleshooting.py)
add_test(NAME Pages.AMessageThatWentIsSeen
  COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/check_troubleshooting.py --self-test)
