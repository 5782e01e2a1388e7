# `cpack` in the build folder makes a Debian package; tools/package makes and tries it in a fresh system.
include_guard(GLOBAL)

install(TARGETS imuscope imusim RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
# Installed under the same name, as a vehicle has one of them. In the build its file has its own: `--target imuscope` would
# build either of two files of one name.
install(TARGETS imuscope_live RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT live)
install(CODE "set(folder \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_BINDIR}\")
              file(RENAME \"\${folder}/imuscope_live\" \"\${folder}/imuscope\")" COMPONENT live)
install(PROGRAMS tools/spy DESTINATION ${CMAKE_INSTALL_BINDIR} RENAME imuscope-spy)
# What a program itself says of its commands, where each shell looks for it.
function(install_completions program component)
  set(completions ${CMAKE_BINARY_DIR}/completions/${program})
  foreach(shell bash zsh fish)
    add_custom_command(OUTPUT ${completions}/${shell}
      COMMAND ${CMAKE_COMMAND} -E make_directory ${completions}
      COMMAND ${program} completion ${shell} > ${completions}/${shell}
      DEPENDS ${program} VERBATIM)
    list(APPEND completion_files ${completions}/${shell})
  endforeach()
  add_custom_target(completions_of_${program} ALL DEPENDS ${completion_files})
  add_dependencies(completions completions_of_${program})
  install(FILES ${completions}/bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME imuscope
          COMPONENT ${component})
  install(FILES ${completions}/zsh DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions RENAME _imuscope
          COMPONENT ${component})
  install(FILES ${completions}/fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d
          RENAME imuscope.fish COMPONENT ${component})
endfunction()
add_custom_target(completions)
install_completions(imuscope Unspecified)
install_completions(imuscope_live live)

# What an office and a vehicle have alike.
foreach(component Unspecified live)
  install(FILES config/imuscope.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT ${component})
  install(DIRECTORY config/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/examples COMPONENT ${component}
          FILES_MATCHING PATTERN *.toml PATTERN *.dbc PATTERN vehicle.toml EXCLUDE)
  install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/docs COMPONENT ${component}
          FILES_MATCHING PATTERN *.md PATTERN *.png PATTERN examples/*.toml
          PATTERN index.md EXCLUDE PATTERN developer.md EXCLUDE PATTERN api.md EXCLUDE)
  foreach(driver csv can_odometry rtklib_pos)
    install(FILES drivers/${driver}/README.md DESTINATION ${CMAKE_INSTALL_DOCDIR}/drivers/${driver} COMPONENT ${component})
  endforeach()
  install(FILES CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT ${component})
  # These three have their place whatever the prefix.
  install(FILES config/vehicle.toml DESTINATION /etc/imuscope COMPONENT ${component})
  install(FILES config/imuscope.service DESTINATION /lib/systemd/system COMPONENT ${component})
  install(FILES config/60-imuscope.rules DESTINATION /lib/udev/rules.d COMPONENT ${component})
endforeach()
configure_file(${CMAKE_CURRENT_LIST_DIR}/debian/README.md.in ${CMAKE_BINARY_DIR}/package/README.md @ONLY)
install(FILES ${CMAKE_BINARY_DIR}/package/README.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
configure_file(${CMAKE_CURRENT_LIST_DIR}/debian/live/README.md.in ${CMAKE_BINARY_DIR}/package/live/README.md @ONLY)
install(FILES ${CMAKE_BINARY_DIR}/package/live/README.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT live)

# imuscope is all of it, imuscope-live what a vehicle needs; a PC has one of them. Beside imuscope, where the parts are
# built, what only some want.
set(CPACK_GENERATOR DEB)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_COMPONENTS_ALL Unspecified live)
set(CPACK_PACKAGE_NAME imuscope)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_PACKAGE_CONTACT "imuscope developers <imuscope@localhost>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_NAME imuscope)
set(CPACK_DEBIAN_UNSPECIFIED_DESCRIPTION ${PROJECT_DESCRIPTION})
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_RECOMMENDS "liblcm-bin, iproute2")
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_SUGGESTS
    "imuscope-hdf5, python3-imuscope, chromium-headless-shell | chromium, default-jre, liblcm-java, libjchart2d-java, can-utils")
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_CONTROL_EXTRA
    ${CMAKE_CURRENT_LIST_DIR}/debian/conffiles
    ${CMAKE_CURRENT_LIST_DIR}/debian/postinst
    ${CMAKE_CURRENT_LIST_DIR}/debian/prerm
    ${CMAKE_CURRENT_LIST_DIR}/debian/postrm)

set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_CONFLICTS imuscope-live)
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_REPLACES imuscope-live)

set(CPACK_DEBIAN_LIVE_PACKAGE_NAME imuscope-live)
set(CPACK_DEBIAN_LIVE_DESCRIPTION "imuscope's live service alone, for the PC of a vehicle")
set(CPACK_DEBIAN_LIVE_PACKAGE_RECOMMENDS "iproute2")
set(CPACK_DEBIAN_LIVE_PACKAGE_SUGGESTS "can-utils")
set(CPACK_DEBIAN_LIVE_PACKAGE_CONTROL_EXTRA ${CPACK_DEBIAN_UNSPECIFIED_PACKAGE_CONTROL_EXTRA})
set(CPACK_DEBIAN_LIVE_PACKAGE_CONFLICTS imuscope)
set(CPACK_DEBIAN_LIVE_PACKAGE_REPLACES imuscope)

if(TARGET _imuscope)
  list(APPEND CPACK_COMPONENTS_ALL python)
  math(EXPR next_minor "${IMUSCOPE_PYTHON_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-imuscope)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_DESCRIPTION "imuscope for Python: noise models, runs, captures, studies and live data")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
      "python3 (>= 3.${IMUSCOPE_PYTHON_MINOR}), python3 (<< 3.${next_minor}), python3-numpy")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA
      ${CMAKE_CURRENT_LIST_DIR}/debian/python/postinst ${CMAKE_CURRENT_LIST_DIR}/debian/python/prerm)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "imuscope, python3-matplotlib, jupyter-notebook")
endif()
if(TARGET imuscope_hdf5)
  list(APPEND CPACK_COMPONENTS_ALL hdf5)
  set(CPACK_DEBIAN_HDF5_PACKAGE_NAME imuscope-hdf5)
  set(CPACK_DEBIAN_HDF5_DESCRIPTION "imuscope's runs as HDF5 files, for MATLAB, h5py, Julia, R")
  # The module is loaded by the program and by none of another version.
  set(CPACK_DEBIAN_HDF5_PACKAGE_DEPENDS "imuscope (= ${PROJECT_VERSION})")
endif()
include(CPack)
