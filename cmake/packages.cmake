# The Debian packages: tools/package makes them in build/packages. Each is one component of install.cmake.
#   invar-runtime  the program and what a cell needs to run; the user `invar`
#   invar-vision   cameras and pictures, which stand on OpenCV
#   invar-dev      headers, libraries and examples for components outside the tree
#   invar-tools    pages to read, and what reports and deployments call
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME invar)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "The Invar developers <invar@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "component framework for industrial cells")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_COMPONENTS_ALL runtime vision dev tools)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_COMPRESSION_TYPE zstd)
set(CPACK_DEBIAN_PACKAGE_SECTION science)

set(same_version "invar-runtime (= ${PROJECT_VERSION})")
set(CPACK_COMPONENT_RUNTIME_DESCRIPTION "Runs cells: the program invar with its components, register maps and examples of cells.")
set(CPACK_COMPONENT_VISION_DESCRIPTION "Cameras and pictures for cells of Invar.")
set(CPACK_DEBIAN_VISION_PACKAGE_DEPENDS "${same_version}")
set(CPACK_COMPONENT_DEV_DESCRIPTION "Headers, libraries and examples for own components and programs on Invar.")
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "${same_version}, g++, cmake, pkg-config, libfastrtps-dev, libfastcdr-dev, libyaml-cpp-dev, \
libeigen3-dev, nlohmann-json3-dev, zlib1g-dev, libmodbus-dev, libzstd-dev, liblz4-dev, libmuparser-dev")
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_COMPONENT_TOOLS_DESCRIPTION "Pages of Invar, and the programs that its reports and deployments call.")
set(CPACK_DEBIAN_TOOLS_PACKAGE_DEPENDS "${same_version}, gnuplot-nox, openssh-client")
set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION doc)

# The user of services; made at the installation, and left when the package goes, as its files may be.
file(WRITE ${CMAKE_BINARY_DIR}/packages/invar.conf "u invar - \"Invar cells\" /var/lib/invar\n")
file(WRITE ${CMAKE_BINARY_DIR}/packages/postinst "#!/bin/sh
set -e
if [ \"$1\" = configure ] && ! getent passwd invar >/dev/null; then
  if command -v systemd-sysusers >/dev/null; then systemd-sysusers /usr/lib/sysusers.d/invar.conf
  elif command -v useradd >/dev/null; then
    useradd --system --user-group --no-create-home --home-dir /var/lib/invar --shell /usr/sbin/nologin invar
  fi
fi
")
file(CHMOD ${CMAKE_BINARY_DIR}/packages/postinst PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
  WORLD_EXECUTE)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_CONTROL_EXTRA ${CMAKE_BINARY_DIR}/packages/postinst)
install(FILES ${CMAKE_BINARY_DIR}/packages/invar.conf DESTINATION lib/sysusers.d COMPONENT runtime)
include(CPack)
