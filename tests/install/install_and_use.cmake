# SPDX-License-Identifier: MIT
# cmake -DBUILD= -DCONFIG= -DCLIENT= -DWORK= -DCXX= -DCXX_FLAGS= -DGENERATOR= -DMAKE= -P this
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix --config ${CONFIG})

# Eigen is for Kerf's sources only: a client must neither need nor see it.
file(GLOB_RECURSE headers ${WORK}/prefix/include/kerf/*.hpp)
if(NOT headers)
  message(FATAL_ERROR "no header was installed below ${WORK}/prefix/include/kerf")
endif()
file(GLOB_RECURSE packages ${WORK}/prefix/*.cmake)
foreach(file IN LISTS headers packages)
  file(STRINGS ${file} found REGEX "Eigen/|Eigen3::")
  if(found)
    message(FATAL_ERROR "${file} leads to Eigen: ${found}")
  endif()
endforeach()

run(${CMAKE_COMMAND} -S ${CLIENT} -B ${WORK}/build -G ${GENERATOR} -DCMAKE_MAKE_PROGRAM=${MAKE}
  -DCMAKE_BUILD_TYPE=${CONFIG} -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_CXX_FLAGS=${CXX_FLAGS}
  -DCMAKE_PREFIX_PATH=${WORK}/prefix)
run(${CMAKE_COMMAND} --build ${WORK}/build)
run(${WORK}/build/client)
