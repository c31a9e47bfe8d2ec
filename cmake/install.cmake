# `cmake --install build --prefix DIR` makes a package for components outside the tree: find_package(invar). Each part belongs to
# one of the Debian packages of packages.cmake: runtime, vision, dev, tools.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# What a component needs: the API, the types, Modbus for a driver; and for programs the diagnosis with what it stands on. Tools and
# devices stay inside.
set(INVAR_PACKAGE invar_base invar_config invar_component invar_idl invar_modbus
  invar_diagnosis invar_model invar_physics invar_recording invar_idl_texts invar_numerics)
install(TARGETS ${INVAR_PACKAGE} EXPORT invar
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev
  FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/invar COMPONENT dev)
install(DIRECTORY ${CMAKE_BINARY_DIR}/idl/generated/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/invar COMPONENT dev
  FILES_MATCHING PATTERN "*.h" PATTERN "*.hpp")
install(FILES ${CMAKE_BINARY_DIR}/core/abi_names.txt cmake/abi_stamp.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/invar COMPONENT dev)
# For programs on another DDS, which make their types of them.
install(DIRECTORY idl/ DESTINATION ${CMAKE_INSTALL_DATADIR}/invar/idl COMPONENT dev FILES_MATCHING PATTERN "*.idl")
install(TARGETS invar RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT runtime)
install(EXPORT invar NAMESPACE invar:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/invar FILE invar-targets.cmake
  COMPONENT dev)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/invar-config.cmake.in ${CMAKE_BINARY_DIR}/invar-config.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/invar PATH_VARS CMAKE_INSTALL_INCLUDEDIR)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/invar-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/invar-config.cmake ${CMAKE_BINARY_DIR}/invar-config-version.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/invar COMPONENT dev)
install(DIRECTORY deployment/ DESTINATION ${CMAKE_INSTALL_DATADIR}/invar/deployment COMPONENT runtime)
# What a reader needs beside the program: the pages, and the examples that they build.
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT tools)
install(DIRECTORY examples/ DESTINATION ${CMAKE_INSTALL_DATADIR}/invar/examples COMPONENT dev)
