# SPDX-License-Identifier: MIT
# cmake -DCLIENT= -DGENERATOR= -DMAKE= -DCXX= -DCXX_FLAGS= -DCONFIG= -DBUILD= -DWORK= [-DSOURCE=] -P this
# Installs the Kerf of BUILD below WORK, and builds and runs CLIENT against it. With SOURCE, BUILD is
# made first: the libraries alone, without SuiteSparse, for any machine, many sources at once, and
# without symbols for a debugger, since another build compiles each alone and as it is released.
set(how -G ${GENERATOR} -DCMAKE_MAKE_PROGRAM=${MAKE} -DCMAKE_BUILD_TYPE=${CONFIG}
  -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_CXX_FLAGS=${CXX_FLAGS})

function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

function(expect_no pattern what)
  foreach(file IN LISTS ARGN)
    file(STRINGS ${file} found REGEX "${pattern}")
    if(found)
      message(FATAL_ERROR "${file} leads to ${what}: ${found}")
    endif()
  endforeach()
endfunction()

if(SOURCE)
  run(${CMAKE_COMMAND} -S ${SOURCE} -B ${BUILD} ${how}
    -DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=16 -DCMAKE_CXX_FLAGS_DEBUG=
    "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG"
    -DKERF_NATIVE=OFF -DKERF_DISPATCH=OFF -DKERF_SUITESPARSE=OFF -DKERF_APP=OFF -DKERF_TESTS=OFF -DKERF_BENCH=OFF)
  run(${CMAKE_COMMAND} --build ${BUILD})
endif()
file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix --config ${CONFIG})

file(GLOB_RECURSE headers ${WORK}/prefix/include/kerf/*.hpp)
file(GLOB_RECURSE targets ${WORK}/prefix/*/kerfTargets.cmake)
if(NOT headers OR NOT targets)
  message(FATAL_ERROR "no headers or no targets were installed below ${WORK}/prefix")
endif()
expect_no("Eigen/|Eigen3::" "Eigen, which is for Kerf's sources only" ${headers} ${targets})
if(SOURCE)
  expect_no("CHOLMOD" "SuiteSparse, which is switched off" ${targets})
endif()

run(${CMAKE_COMMAND} -S ${CLIENT} -B ${WORK}/build ${how} -DCMAKE_PREFIX_PATH=${WORK}/prefix)
run(${CMAKE_COMMAND} --build ${WORK}/build)
run(${WORK}/build/client)
