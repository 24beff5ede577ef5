# SPDX-License-Identifier: MIT
# The end of configuring: what was found, which options hold, what is off and why.
set(warnings "")
if(KERF_WERROR)
  set(warnings ", warnings are errors")
endif()
set(native "any machine of this kind")
if(KERF_NATIVE AND KERF_HAS_MARCH_NATIVE)
  set(native "machines like this one (KERF_NATIVE)")
elseif(KERF_WITH_DISPATCH)
  string(APPEND native ", and the fast backend picks baseline, AVX2 or AVX-512 at run time")
elseif(KERF_DISPATCH)
  string(APPEND native ", with its baseline alone: ${KERF_NO_DISPATCH}")
endif()

set(factorisation "Eigen's own, as KERF_SUITESPARSE is off")
if(KERF_WITH_CHOLMOD)
  set(factorisation "CHOLMOD ${CHOLMOD_VERSION} (its supernodal module is under the GPL)")
elseif(KERF_SUITESPARSE)
  set(factorisation "Eigen's own, as CHOLMOD was not found (Debian: libsuitesparse-dev)")
endif()

set(cuda "no backend, as KERF_CUDA is off")
if(KERF_CUDA)
  set(cuda "nvcc ${CMAKE_CUDA_COMPILER_VERSION}, for architecture ${CMAKE_CUDA_ARCHITECTURES}")
elseif(CMAKE_CUDA_COMPILER)
  string(APPEND cuda ", but nvcc ${CMAKE_CUDA_COMPILER_VERSION} checks that kernels/ compile")
elseif(KERF_TESTS AND KERF_CUDA_CHECK)
  string(APPEND cuda ", and kernels/ not compiled for it, as no nvcc of version 12 or newer was found")
endif()

set(built kerf::kerf)
foreach(part APP TESTS BENCH)
  string(TOLOWER ${part} name)
  if(KERF_${part})
    list(APPEND built ${name})
  else()
    list(APPEND left_out ${name})
  endif()
endforeach()
list(JOIN built ", " built)
if(left_out)
  list(JOIN left_out ", " left_out)
  string(APPEND built " (off: ${left_out})")
endif()

get_property(lines GLOBAL PROPERTY KERF_SUMMARY)
list(PREPEND lines
  "compiler|${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION}, ${CMAKE_BUILD_TYPE}${warnings}"
  "runs on|${native}"
  "built|${built}"
  "Eigen|${Eigen3_VERSION}"
  "OpenMP|${OpenMP_CXX_VERSION}"
  "factorisation|${factorisation}"
  "CUDA|${cuda}")
message(STATUS "Kerf ${PROJECT_VERSION}")
foreach(line IN LISTS lines)
  string(REGEX MATCH "^([^|]*)[|](.*)$" line "${line}")
  set(name "${CMAKE_MATCH_1}")
  set(line "${CMAKE_MATCH_2}")
  string(SUBSTRING "${name}              " 0 14 name)
  message(STATUS "  ${name} ${line}")
endforeach()
