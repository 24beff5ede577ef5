# SPDX-License-Identifier: MIT
# SuiteSparse before version 7 installs no CMake package. Gives the target SuiteSparse::CHOLMOD,
# under the name that newer versions of SuiteSparse give it.
find_path(CHOLMOD_INCLUDE_DIR cholmod.h PATH_SUFFIXES suitesparse)
find_library(CHOLMOD_LIBRARY cholmod)
mark_as_advanced(CHOLMOD_INCLUDE_DIR CHOLMOD_LIBRARY)

if(CHOLMOD_INCLUDE_DIR AND EXISTS ${CHOLMOD_INCLUDE_DIR}/cholmod_core.h)
  file(STRINGS ${CHOLMOD_INCLUDE_DIR}/cholmod_core.h lines REGEX "CHOLMOD_(MAIN|SUB|SUBSUB)_VERSION +[0-9]+$")
  string(REGEX REPLACE "[^0-9]*([0-9]+)[^0-9]*" "\\1;" numbers "${lines}")
  list(REMOVE_ITEM numbers "")
  list(JOIN numbers "." CHOLMOD_VERSION)
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(CHOLMOD
  REQUIRED_VARS CHOLMOD_LIBRARY CHOLMOD_INCLUDE_DIR VERSION_VAR CHOLMOD_VERSION)

if(CHOLMOD_FOUND AND NOT TARGET SuiteSparse::CHOLMOD)
  add_library(SuiteSparse::CHOLMOD UNKNOWN IMPORTED)
  set_target_properties(SuiteSparse::CHOLMOD PROPERTIES
    IMPORTED_LOCATION ${CHOLMOD_LIBRARY} INTERFACE_INCLUDE_DIRECTORIES ${CHOLMOD_INCLUDE_DIR})
endif()
