# The stamp of what a plug-in is compiled against: a hash over the headers, names and contents, of the package.
# In the build: cmake -D LIST=headers.txt -D OUT=abi.hpp -D VERSION=0.1.0 -P abi_stamp.cmake; in a package: invar_abi_hash().

# LIST: lines of `folder|name`; a name is told as it is included.
function(invar_abi_hash list result)
  file(STRINGS ${list} entries)
  list(SORT entries)
  set(all "")
  foreach(entry IN LISTS entries)
    string(REPLACE "|" ";" parts "${entry}")
    list(GET parts 0 folder)
    list(GET parts 1 name)
    file(SHA256 ${folder}/${name} one)
    list(APPEND all "${name} ${one}")
  endforeach()
  list(SORT all)
  string(SHA256 hash "${all}")
  string(SUBSTRING ${hash} 0 16 hash)
  set(${result} ${hash} PARENT_SCOPE)
endfunction()

if(CMAKE_SCRIPT_MODE_FILE STREQUAL CMAKE_CURRENT_LIST_FILE)
  invar_abi_hash(${LIST} INVAR_ABI_HEADERS)
  set(INVAR_ABI_VERSION ${VERSION})
  configure_file(${CMAKE_CURRENT_LIST_DIR}/abi.hpp.in ${OUT} @ONLY)
endif()
