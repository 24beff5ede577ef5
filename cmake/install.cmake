# SPDX-License-Identifier: MIT
# Installed tree: include/kerf/{kernels,core,cpu,gpu}/..., lib/, lib/cmake/kerf/, bin/kerf.
set(kerf_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/kerf)
list(TRANSFORM kerf_parts PREPEND kerf_ OUTPUT_VARIABLE kerf_targets)
install(TARGETS ${kerf_targets} EXPORT kerf
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
  FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/kerf)
install(EXPORT kerf NAMESPACE kerf:: FILE kerfTargets.cmake DESTINATION ${kerf_cmake_dir})

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/kerfConfig.cmake.in kerfConfig.cmake
  INSTALL_DESTINATION ${kerf_cmake_dir} NO_SET_AND_CHECK_MACRO NO_CHECK_REQUIRED_COMPONENTS_MACRO)
write_basic_package_version_file(kerfConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/kerfConfig.cmake ${PROJECT_BINARY_DIR}/kerfConfigVersion.cmake
  ${CMAKE_CURRENT_LIST_DIR}/FindCHOLMOD.cmake DESTINATION ${kerf_cmake_dir})
