# One pass of the independent reader. Variables: SOURCE (this folder), FOLDER (in the build tree), NODE, NPM, and
# WRITER (the program that makes the recordings) unless INSTALL is set: then the reader's packages are installed.
file(MAKE_DIRECTORY ${FOLDER})
foreach(name package.json read_recordings.mjs)
  file(COPY_FILE ${SOURCE}/${name} ${FOLDER}/${name} ONLY_IF_DIFFERENT)
endforeach()

function(run)
  execute_process(COMMAND ${ARGN} WORKING_DIRECTORY ${FOLDER} COMMAND_ECHO NONE RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "${ARGN}: ${status}")
  endif()
endfunction()

if(INSTALL)
  run(${NPM} install --no-package-lock --no-audit --no-fund --loglevel=error)
else()
  run(${WRITER} ${FOLDER})
  run(${NODE} read_recordings.mjs ${FOLDER})
endif()
